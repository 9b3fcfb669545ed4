"""Writing volumes as NIfTI files: lengths in mm, positions in RAS."""

import gzip
from pathlib import Path

from ..atomic import atomic_replace
from ..bounded_reading import UNITS_M
from .content import Content

# Largest number of nodes along an axis in the header of NIfTI-1.
MAX_NODES = 2**15 - 1
# Code for coordinates of the scanner.
SCANNER = 1


def write(path: Path, content: Content) -> None:
    """Write the values as NIfTI-1, or as NIfTI-2 where an axis is too long; see ``ExportFormat.write``.

    The file is compressed with gzip if its name ends in ``.gz``. The title is truncated.
    """
    from nibabel.nifti1 import Nifti1Image
    from nibabel.nifti2 import Nifti2Image

    affine = content.grid.affine(UNITS_M["mm"])
    kind = Nifti1Image if max(content.values.shape) <= MAX_NODES else Nifti2Image
    image = kind(content.values, affine)
    image.set_sform(affine, SCANNER)
    image.set_qform(affine, SCANNER)
    image.header.set_xyzt_units("mm")
    length = image.header["descrip"].dtype.itemsize
    image.header["descrip"] = content.title.encode()[:length].decode(errors="ignore").encode()
    with atomic_replace(path) as partial, partial.open("wb") as file:
        if path.name.lower().endswith(".gz"):
            # Without name and time: the same volume gives the same bytes.
            with gzip.GzipFile("", "wb", fileobj=file, mtime=0) as packed:
                image.to_stream(packed)
        else:
            image.to_stream(file)
