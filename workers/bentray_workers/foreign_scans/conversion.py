"""Conversion of scans of all accepted formats to a canonical file, one emission at a time."""

from collections.abc import Callable, Iterator
from pathlib import Path

from bentray_kernels.acquisition import Dataset
from bentray_kernels.acquisition.plausibility import ImplausibleUnit
from bentray_kernels.errors import InvalidInput

from ..files.dataset.copy import copy_dataset
from ..files.dataset.read import kept_traces
from ..files.dataset.write import Piece, bytes_of, write_dataset
from ..files.zip_checks import plain_name
from . import kit, kwave, layouts, openusct, zea
from .arrays import Arrays
from .layouts import named_layout
from .matlab import Matlab73
from .open_scan import Layout, OpenScan, ScanReader, open_scan
from .scan_metadata import POSITION, ArraysWithMetadata, ScanMetadata

# A new format is one file and one entry; the first that detects a file reads it.
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


def convert_dataset(
    source: Path,
    target: Path,
    on_size: Callable[[int], None] = lambda size: None,
    given: ScanMetadata | None = None,
) -> Dataset:
    """Check a scan and write it as a canonical file, with one emission in memory at a time.

    Accepted are the upload format and the formats of ``READERS``, detected by content. Other files are
    rejected as the upload format.

    Args:
        source: of the scan.
        target: replaced atomically.
        on_size: called before writing with the largest size of ``target`` without headers, bytes.
        given: stated by the user: own names of variables, units, water and frequency.

    Returns:
        The dataset, with placeholders for traces.

    Raises:
        InvalidInput: naming the first missing or wrong field, the value found and the accepted values.
        OSError: where the folder cannot be written to or the disk is full.
    """
    given = given or ScanMetadata()
    with open_scan(source, target.parent) as scan:
        if not scan.claims_upload_format() and not (scan.is_upload_format() and not given.variables):
            arrays, layout = _read(scan, given)
            return _write(arrays, layout, target, on_size)
        if given and scan.claims_upload_format():
            accepted = (
                "none: files in the upload format state their units, water and frequency; the setting "
                "water_temperature_c (--water-temperature) replaces the water, bentray correct the others"
            )
            raise InvalidInput(given.words(), "given for this file", accepted)
    return copy_dataset(source, target, on_size)


def is_upload_format(path: Path) -> bool:
    """Whether a file is in the upload format, or in no known format, and needs no conversion."""
    with open_scan(path, path.parent) as scan:
        return scan.is_upload_format()


def _read(scan: OpenScan, given: ScanMetadata) -> tuple[Arrays, Layout]:
    """The arrays of a file and the dataset in them."""
    if POSITION in given.variables:
        # Own variables: no known layout has them.
        if scan.arrays is None:
            raise InvalidInput("map", "variables for this kind of file", "a MATLAB, HDF5 or NumPy file")
        reads: Callable[[Arrays], Layout] = named_layout
        own = scan.arrays
        if isinstance(own, Matlab73) and not scan.is_matlab and not _of_matlab(scan, given):
            # No MATLAB wrote the variables that the user names.
            own.reversed_axes = False
    else:
        reader = reader_of(scan)
        reads = reader.layout or named_layout
        own = reader.read(scan)
    arrays: Arrays = ArraysWithMetadata(own, given) if given else own
    try:
        return arrays, reads(arrays)
    except ImplausibleUnit as error:
        if not error.unit:
            raise
        accepted = f"{error.accepted}, or state the unit: --unit {error.unit.replace('µ', 'u')}"
        raise InvalidInput(error.field, error.value, accepted) from None


def _of_matlab(scan: OpenScan, given: ScanMetadata) -> bool:
    """Whether MATLAB wrote the variables of an HDF5 file without its header."""
    assert scan.hdf5 is not None
    return any(scan.hdf5.attribute(name, "MATLAB_class") is not None for name in given.variables.values())


def _write(arrays: Arrays, layout: Layout, target: Path, on_size: Callable[[int], None]) -> Dataset:
    on_size(bytes_of(layout.dataset))

    def pieces(name: str, chunk: tuple[int, ...]) -> Iterator[Piece]:
        path = layout.traces[name]
        for e, emission in enumerate(arrays.rows(path)):
            where = (slice(e, e + 1), slice(0, emission.shape[0]), slice(0, emission.shape[1]))
            yield where, kept_traces(emission[None])

    write_dataset(target, layout.dataset, pieces)
    return layout.dataset


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
