"""Opening a foreign scan by its content: MATLAB 5, HDF5, a zip, or a folder; and the record of a reader."""

import zipfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import h5py

from bentray_kernels.acquisition import Dataset
from bentray_kernels.errors import InvalidInput

from ..files import npz
from ..files.damage import first_bytes, rejecting_damage
from ..files.dataset.read import FORMAT
from ..files.hdf5_reading import SIGNATURE, Reader, opened
from . import matlab
from .arrays import Arrays
from .matlab import Matlab73

# HDF5 may begin after a user block; that of MATLAB 7.3 has 512 bytes.
USER_BLOCK = 512
MATLAB73 = b"MATLAB 7.3 MAT-file"

# Kinds of files that hold scans.
SCANS = "a scan in HDF5, MATLAB or NumPy (.npz), or a zip or folder of a documented format"


@dataclass(frozen=True)
class OpenScan:
    """An open scan; of ``matlab``, ``hdf5``, ``archive`` and ``folder`` one is present, or none.

    Attributes:
        scratch: folder for temporary files.
        matlab: a MATLAB 5 file.
        hdf5: an HDF5 file.
        archive: a zip.
        folder: a folder of files.
        is_matlab: whether an HDF5 file has the header of MATLAB 7.3.
    """

    scratch: Path
    matlab: Arrays | None = None
    hdf5: Reader | None = None
    archive: zipfile.ZipFile | None = None
    folder: Path | None = None
    is_matlab: bool = False

    @cached_property
    def arrays(self) -> Arrays | None:
        """The plain arrays of a MATLAB file, an HDF5 file or a NumPy archive.

        Raises:
            InvalidInput: for a damaged archive.
        """
        if self.hdf5 is not None:
            return Matlab73(self.hdf5, is_matlab=self.is_matlab)
        return self.matlab if self.archive is None else npz.Npz(self.archive)

    @cached_property
    def members(self) -> frozenset[str]:
        """Names of the members of a zip or of the files in a folder; unchecked, for comparisons only."""
        if self.archive is not None:
            return frozenset(self.archive.namelist())
        if self.folder is None:
            return frozenset()
        return frozenset(
            path.relative_to(self.folder).as_posix() for path in self.folder.rglob("*") if path.is_file()
        )

    @cached_property
    def names(self) -> frozenset[str]:
        """Names of plain arrays; those of a zip are unchecked, for comparisons only."""
        if self.archive is not None:
            members = (name for name in self.members if name.endswith(npz.SUFFIX))
            return frozenset(name.removesuffix(npz.SUFFIX) for name in members)
        return frozenset() if self.arrays is None else frozenset(self.arrays.names())

    def has(self, *paths: str) -> bool:
        """Whether an HDF5 file has groups or arrays at all of these paths; links are not followed."""
        if self.hdf5 is None:
            return False
        try:
            return all(map(self.hdf5.contains, paths))
        except InvalidInput:
            # A link.
            return False

    def is_upload_format(self) -> bool:
        """Whether this is a file in the upload format, or claims to be; also if it has no known format."""
        if self.hdf5 is None:
            return self.matlab is None and self.archive is None and self.folder is None
        format_name = self.hdf5.attribute("", "format")
        # Groups of the upload format in a file whose author forgot the attribute.
        return format_name is not None or (not self.is_matlab and self.has("geometry/element_position_m"))

    def claims_upload_format(self) -> bool:
        """Whether the attribute ``format`` names the upload format."""
        return self.hdf5 is not None and self.hdf5.attribute("", "format") == FORMAT


@contextmanager
def open_scan(path: Path, scratch: Path) -> Iterator[OpenScan]:
    """Open a file or a folder.

    Args:
        path: of the scan.
        scratch: folder for temporary files.

    Raises:
        InvalidInput: for a damaged file, and for one of another kind.
    """
    if path.is_dir():
        yield OpenScan(scratch, folder=path)
        return
    try:
        with path.open("rb") as file:
            start = file.read(USER_BLOCK + len(SIGNATURE))
    except OSError as error:
        raise InvalidInput("file", f"{path.name}: {error.strerror}", "a scan") from None
    if start.startswith(matlab.START):
        yield OpenScan(scratch, matlab=matlab.Matlab5(path))
    elif start.startswith(npz.START):
        with rejecting_damage("file", npz.WHOLE):
            archive = zipfile.ZipFile(path)
        with archive:
            yield OpenScan(scratch, archive=archive)
    elif start.startswith(SIGNATURE) or (start.startswith(MATLAB73) and start[USER_BLOCK:] == SIGNATURE):
        with opened(path) as reader:
            yield OpenScan(scratch, hdf5=reader, is_matlab=not start.startswith(SIGNATURE))
    elif start and not h5py.is_hdf5(path):
        raise InvalidInput("file", f"a file that is not HDF5 ({first_bytes(start)})", SCANS)
    else:
        # Empty, or HDF5 after a user block of another program.
        yield OpenScan(scratch)


@dataclass(frozen=True)
class Layout:
    """A dataset with placeholders for traces, and the names of the arrays with the traces."""

    dataset: Dataset
    traces: Mapping[str, str]


@dataclass(frozen=True)
class Variable:
    """A variable of a format: name, shape in the order of its program, unit, and meaning.

    Attributes:
        required: "yes", "no", or a condition.
    """

    name: str
    shape: str
    unit: str
    meaning: str
    required: str = "yes"


def _arrays(scan: OpenScan) -> Arrays:
    assert scan.arrays is not None
    return scan.arrays


@dataclass(frozen=True)
class ScanReader:
    """A format of scans.

    Attributes:
        title: heading of its documentation.
        about: container, source of the format, and conventions.
        variables: its documentation.
        detect: whether an open file has this format, by its content.
        read: its arrays; by default those of the file as they are.
        layout: the dataset in the arrays; None: under the names of the upload format.
    """

    title: str
    about: str
    variables: tuple[Variable, ...]
    detect: Callable[[OpenScan], bool]
    read: Callable[[OpenScan], Arrays] = _arrays
    layout: Callable[[Arrays], Layout] | None = None
