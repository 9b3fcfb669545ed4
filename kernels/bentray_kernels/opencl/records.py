"""Records about a device in the cache folder: read if they are whole, replaced atomically."""

import hashlib
import json
import platform
import tempfile
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from ..compilation.cache_folder import cache_folder
from .devices import Device
from .processor import processor


def record_file(kind: str, device: Device, sources: Iterable[bytes]) -> Path | None:
    """The file of a record; driver, processor and sources determine its name. None without a folder.

    Args:
        kind: first word of the name.
        device: that the record is about.
        sources: of the programs whose results it holds, or digests of them.
    """
    # Hosts with a common home may have different processors of the same generic name.
    digest = hashlib.sha256(repr((device, platform.machine(), sorted(processor()))).encode())
    for source in sources:
        digest.update(source)
    folder = cache_folder()
    return folder and folder / f"{kind}-{digest.hexdigest()[:32]}.json"


def read_record(file: Path | None) -> Any:
    """The content of a record; None if it is absent or damaged."""
    try:
        return json.loads(file.read_text()) if file else None
    except (OSError, ValueError):
        return None


def write_record(file: Path | None, content: Any) -> None:
    """Write a record whole or not at all; without a folder to write to, the next process tests again."""
    if file is None:
        return
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile("w", dir=file.parent, delete=False) as partial:
            json.dump(content, partial)
        Path(partial.name).replace(file)
    except OSError:
        return
