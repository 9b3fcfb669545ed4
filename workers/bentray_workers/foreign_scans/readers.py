"""The table of readers of foreign scans; a new format is one file and one entry."""

from __future__ import annotations

from bentray_kernels.errors import InvalidInput

from . import kit, kwave, layouts, openusct, zea
from .open_scan import OpenScan
from .scan_reader import ScanReader
from .zip_checks import plain_name

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


def reader_of(scan: OpenScan) -> ScanReader:
    """The reader of an open file.

    Raises:
        InvalidInput: naming the arrays of a file in no known format.
    """
    for reader in READERS:
        if reader.detect(scan):
            return reader
    shown = ", ".join(sorted(filter(plain_name, scan.names or scan.members))[:8]) or "none"
    kind = "a folder" if scan.arrays is None else scan.arrays.kind
    raise InvalidInput(
        "file",
        f"{kind} with the arrays {shown}"[:160],
        "delta_tof and element_positions; time, transducerPositionsXY and full_dataset; the names of the "
        "upload format; another documented format; or own names, e.g. --map element_position=NAME --map "
        "delta_tof=NAME",
    )
