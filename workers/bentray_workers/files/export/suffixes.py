"""File formats by the suffix of a file name."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType

from bentray_kernels.errors import InvalidInput

# OME-Zarr is a folder or a zip.
SUFFIXES: Mapping[str, str] = MappingProxyType(
    {
        ".h5": "hdf5",
        ".hdf5": "hdf5",
        ".npy": "npy",
        ".nii": "nifti",
        ".nii.gz": "nifti",
        ".nrrd": "nrrd",
        ".mha": "metaimage",
        ".mat": "mat",
        ".vti": "vti",
        ".zarr": "ome-zarr",
        ".ozx": "ome-zarr",
        ".zip": "ome-zarr",
        ".dcm": "dicom",
    }
)
# Compressed while it is written; a service sends files as they are.
COMPRESSED = ".nii.gz"


def format_of(path: Path, suffixes: Mapping[str, str] = SUFFIXES) -> str:
    """The format of a file by its name, in capitals or small letters.

    Raises:
        InvalidInput: naming ``output``, for a name that ends in none of the suffixes.
    """
    name = path.name.lower()
    file_format = next((form for suffix, form in suffixes.items() if name.endswith(suffix)), None)
    if file_format is None:
        raise InvalidInput("output", path, "a name ending in " + ", ".join(suffixes))
    return file_format
