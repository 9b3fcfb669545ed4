"""The table of readers of foreign scans; a new format is one file and one entry."""

from __future__ import annotations

from bentray_kernels.errors import InvalidInput

from ..files.zip_checks import plain_name
from . import kit, kwave, layouts, openusct, zea
from .open_scan import OpenScan
from .scan_reader import ScanReader

# The first that detects a file reads it.
READERS: tuple[ScanReader, ...] = (
    zea.READER,
    openusct.READER,
    kit.READER,
    kwave.READER,
    layouts.FULL_DATASET,
    layouts.DELTA_TOF,
    layouts.NAMED,
)

# Names of arrays or files that an error repeats.
SHOWN = 8
ACCEPTED = (
    "the names of a documented format of scans, or own names of variables: --map element_position=NAME "
    "--map delta_tof=NAME (map in Python and REST)"
)


def reader_of(scan: OpenScan) -> ScanReader:
    """The reader of an open file.

    Raises:
        InvalidInput: naming the arrays of a file in no known format.
    """
    for reader in READERS:
        if reader.detect(scan):
            return reader
    names = sorted(filter(plain_name, scan.names or scan.members))
    shown = ", ".join([*names[:SHOWN], *["…"][: len(names) > SHOWN]]) or "none"
    kind = "a folder with the files" if scan.arrays is None else f"{scan.arrays.kind} with the arrays"
    raise InvalidInput("file", f"{kind} {shown}", ACCEPTED)
