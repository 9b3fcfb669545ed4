"""A small volume, and the words in which a bad one is refused."""

from pathlib import Path

import numpy as np
import pytest

from bentray_kernels.errors import InvalidInput
from bentray_workers.files.volume_formats import VolumeMetadata, import_volume


def ramp(shape=(3, 4, 5), dtype=np.uint8) -> np.ndarray:
    return np.arange(np.prod(shape)).reshape(shape).astype(dtype)


def refused(path: Path, given: VolumeMetadata | None = None) -> InvalidInput:
    with pytest.raises(InvalidInput) as caught:
        import_volume(path, given)
    return caught.value
