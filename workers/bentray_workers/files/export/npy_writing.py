"""Writing the values of volumes as NumPy arrays."""

from pathlib import Path

import numpy as np

from ..atomic import atomic_replace
from .content import Content


def write(path: Path, content: Content) -> None:
    """Write the values; see ``ExportFormat.write``."""
    with atomic_replace(path) as partial, partial.open("wb") as file:
        np.save(file, np.ascontiguousarray(content.values), allow_pickle=False)
