"""Records about a device in the cache folder: read if they are whole, replaced atomically."""

from __future__ import annotations

import hashlib
import json
import os
import platform
import tempfile
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from .devices import Device
from .processor import processor


def record_file(kind: str, device: Device, sources: Iterable[bytes]) -> Path:
    """The file of a record; driver, processor and sources determine its name.

    Args:
        kind: first word of the name.
        device: that the record is about.
        sources: of the programs whose results it holds, or digests of them.

    Raises:
        OSError, RuntimeError: without a home.
    """
    # Hosts with a common home may have different processors of the same generic name.
    digest = hashlib.sha256(repr((device, platform.machine(), sorted(processor()))).encode())
    for source in sources:
        digest.update(source)
    home = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    return home / "bentray" / f"{kind}-{digest.hexdigest()[:32]}.json"


def read_record(file: Path) -> Any:
    """The content of a record; None if it is absent or damaged."""
    try:
        return json.loads(file.read_text())
    except (OSError, ValueError):
        return None


def write_record(file: Path, content: Any) -> None:
    """Write a record whole or not at all; without a folder to write to, the next process tests again."""
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile("w", dir=file.parent, delete=False) as partial:
            json.dump(content, partial)
        Path(partial.name).replace(file)
    except OSError:
        return
