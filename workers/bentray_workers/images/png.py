"""RGB arrays as PNG, and pictures as RGB arrays."""

import io
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from PIL.PngImagePlugin import PngInfo

from bentray_kernels.errors import InvalidInput

Colours = NDArray[np.uint8]

# Compresses nearly as well as the highest level, in a fraction of its time.
PACKING = 4

# The key of the device in the metadata of a picture.
DEVICE = "Device"


def png_of(image: Colours, device: str = "") -> bytes:
    """A picture as PNG; the same picture gives the same bytes.

    Args:
        image: (rows, columns, 3), 8-bit RGB.
        device: that drew it, for the metadata; empty: not stated.
    """
    buffer = io.BytesIO()
    picture = Image.fromarray(np.ascontiguousarray(image))
    picture.save(buffer, "PNG", compress_level=PACKING, pnginfo=stated(device))
    return buffer.getvalue()


def stated(device: str) -> PngInfo | None:
    """The metadata of a picture drawn by a device; None if it is not stated."""
    if not device:
        return None
    metadata = PngInfo()
    metadata.add_text(DEVICE, device.encode("latin-1", "replace").decode("latin-1"))
    return metadata


def device_of(path: Path) -> str:
    """The device that drew a picture, by its metadata; empty if it is not stated."""
    with Image.open(path) as picture:
        return str(picture.info.get(DEVICE, ""))


def read_picture(path: Path) -> Colours:
    """Read a picture file of any format of Pillow, (rows, columns, 3) 8-bit RGB.

    Raises:
        InvalidInput: for an absent file, another format, or a picture beyond the limit of Pillow.
    """
    try:
        with Image.open(path) as image:
            return np.asarray(image.convert("RGB"))
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError) as error:
        reason = "no such file" if isinstance(error, FileNotFoundError) else "no picture"
        raise InvalidInput(
            "backdrop", f"{path} ({reason})", "checkerboard, picture, or a picture file"
        ) from None
