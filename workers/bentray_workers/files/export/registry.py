"""The table of export formats; a new format is a file with its writer and one entry here.

Loads no library, since every command lists the formats in its help.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Literal

from bentray_kernels.errors import InvalidInput

if TYPE_CHECKING:
    from .content import Content

FormatName = Literal["hdf5", "npy", "nifti", "nrrd", "metaimage", "mat", "vti", "ome-zarr", "dicom"]


@dataclass(frozen=True)
class ExportFormat:
    """A file format of volumes.

    Attributes:
        title: its name for people.
        suffixes: of file names.
        content: what a file holds.
        positions: unit and axes of the positions of the nodes.
        read_again: which files ``bentray`` reads.
        single: whether a file has one image.
        uneven: whether uneven heights can be stored.
        writer: module of this package whose ``write`` writes a ``Content``; none of HDF5, which is copied.
        media_type: of a download.
        extension: of a download, without a dot; empty: the first suffix.
        local: suffixes of files that a service does not send.
        copies: of one image while it is written (measured).
        copies_all: whether of all images at a time.
        library_bytes: memory of the libraries that it is written by.
    """

    title: str
    suffixes: tuple[str, ...]
    content: str
    positions: str
    read_again: str = "no"
    single: bool = False
    uneven: bool = False
    writer: str = ""
    media_type: str = "application/octet-stream"
    extension: str = ""
    local: tuple[str, ...] = ()
    copies: int = 0
    copies_all: bool = False
    library_bytes: int = 0

    @property
    def download_extension(self) -> str:
        """Extension of the file that a service sends, without a dot."""
        return self.extension or self.suffixes[0][1:]

    def write(self, path: Path, content: Content) -> None:
        """Write a volume; ``path`` is replaced atomically.

        Raises:
            InvalidInput: naming ``volume``, for content that the format cannot store.
            OSError: where the folder cannot be written to or the disk is full.
        """
        if not self.uneven:
            content.check_even(self.title)
        import_module(f".{self.writer}", __package__).write(path, content)


FORMATS: Mapping[FormatName, ExportFormat] = MappingProxyType(
    {
        "hdf5": ExportFormat(
            "HDF5",
            (".h5", ".hdf5"),
            "everything",
            "RAS, m",
            "yes",
            uneven=True,
            media_type="application/x-hdf5",
        ),
        "npy": ExportFormat(
            "NumPy",
            (".npy",),
            "one quantity",
            "none",
            "with a spacing",
            single=True,
            uneven=True,
            writer="npy_writing",
        ),
        "nifti": ExportFormat(
            "NIfTI",
            (".nii", ".nii.gz"),
            "one quantity",
            "RAS, mm (sform and qform)",
            "with any axes",
            single=True,
            writer="nifti_writing",
            local=(".nii.gz",),
        ),
        "nrrd": ExportFormat(
            "NRRD",
            (".nrrd",),
            "one quantity",
            "RAS, mm (`space: right-anterior-superior`)",
            "with any axes and space",
            single=True,
            writer="nrrd_writing",
        ),
        "metaimage": ExportFormat(
            "MetaImage",
            (".mha",),
            "one quantity",
            "LPS, mm (`TransformMatrix`)",
            single=True,
            writer="metaimage_writing",
        ),
        "mat": ExportFormat(
            "MATLAB",
            (".mat",),
            "all images and the grid (version 5)",
            "RAS, m",
            uneven=True,
            writer="mat_writing",
            media_type="application/x-matlab-data",
            copies=1,
        ),
        "vti": ExportFormat(
            "VTK (ParaView)", (".vti",), "all images as ImageData", "RAS, m", writer="vti_writing"
        ),
        "ome-zarr": ExportFormat(
            "OME-Zarr",
            (".zarr", ".ozx", ".zip"),
            "all images as channels of OME-Zarr 0.5, with units in the labels, in a folder or a zip",
            "RAS, m (scale, translation and `orientation`, RFC-4)",
            writer="ome_zarr_writing",
            media_type="application/zip",
            extension="ome.zarr.zip",
            local=(".zarr",),
            copies=1,
            copies_all=True,
            library_bytes=96 * 2**20,
        ),
        "dicom": ExportFormat(
            "DICOM",
            (".dcm",),
            "speed and attenuation as float32 in a Parametric Map, with UCUM units",
            "LPS, mm (`ImageOrientationPatient`)",
            writer="dicom_writing",
            media_type="application/dicom",
            copies=4,
            library_bytes=104 * 2**20,
        ),
    }
)
# All but the format of Bentray itself, which needs no writer.
EXPORTED: Mapping[FormatName, ExportFormat] = MappingProxyType(
    {name: form for name, form in FORMATS.items() if form.writer}
)
SINGLE = tuple(name for name, form in FORMATS.items() if form.single)
SUFFIXES: Mapping[str, FormatName] = MappingProxyType(
    {suffix: name for name, form in FORMATS.items() for suffix in form.suffixes}
)
# Of formats with one image, for help.
SINGLE_SUFFIXES = ", ".join(suffix for suffix, name in SUFFIXES.items() if name in SINGLE)


def format_of(path: Path, suffixes: Mapping[str, FormatName] = SUFFIXES) -> FormatName:
    """The format of a file by its name, in capitals or small letters.

    Raises:
        InvalidInput: naming ``output``, for a name that ends in none of the suffixes.
    """
    name = path.name.lower()
    found = next((form for suffix, form in suffixes.items() if name.endswith(suffix)), None)
    if found is None:
        raise InvalidInput("output", path, "a name ending in " + ", ".join(suffixes))
    return found
