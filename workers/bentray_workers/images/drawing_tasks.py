"""Drawing tasks; they load Matplotlib, which takes 30 MB, only where they run."""

from pathlib import Path
from typing import Any


def slice_png(path: Path, **how: Any) -> bytes:
    """See ``bentray_workers.images.slice.slice_png``."""
    from .slice import slice_png as draw

    return draw(path, **how)


def volume_slice_png(path: Path, **how: Any) -> bytes:
    """See ``bentray_workers.images.slice.volume_slice_png``."""
    from .slice import volume_slice_png as draw

    return draw(path, **how)
