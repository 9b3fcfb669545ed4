"""Checkpoints of one job: where each of its chains stands, in files that prove themselves."""

from __future__ import annotations

import json
import logging
import time
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from bentray_kernels.sources import digest
from bentray_kernels.tomography.checkpoint import packed, unpacked
from bentray_kernels.tomography.task_chains import Standing
from bentray_kernels.tomography.waveform.waveform_checkpoint import TYPES

from ..files.atomic import replacing
from ..files.npy_headers import PARSING

log = logging.getLogger("bentray.checkpoints")

# Within a pass a chain is kept this often, s; each finished pass is kept at once.
INTERVAL_S = 5.0

# The newest file, and the one before it for the case that the newest is damaged.
KEPT = 2

# What a damaged file, or one of another version, may raise.
UNREADABLE = (OSError, ValueError, KeyError, TypeError, IndexError, EOFError, zipfile.BadZipFile)


class Checkpoints:
    """The files of one job in one folder, ``NAME-GENERATION.npz``.

    Each is written aside, reaches the disk and then takes its name. A zip archive holds a check sum of every
    part, so that a damaged file is told from a sound one without a second record. A file of other kernels
    than the present ones is passed over: half a result of each would be a result of neither.

    Args:
        folder: is made if needed; belongs to this job alone.
        on_saved: called after each file.
        clock: seconds.
    """

    def __init__(
        self,
        folder: Path,
        on_saved: Callable[[], None] = lambda: None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._folder = folder
        self._on_saved = on_saved
        self._clock = clock
        self._kept: dict[str, tuple[Standing, float]] = {}
        folder.mkdir(parents=True, exist_ok=True)

    def keep(self, name: str, standing: Standing) -> None:
        """Save where a chain stands, unless it has hardly moved since it was saved last.

        Raises:
            OSError: where the file cannot be written; the ones before it remain.
        """
        if name in self._kept:
            before, saved = self._kept[name]
            # Rows that are being gathered move no state; a long pass of SART does.
            moved = before.state is not standing.state and self._clock() - saved >= INTERVAL_S
            if before.passed == standing.passed and not moved:
                return
        self._save(name, standing)
        self._kept[name] = standing, self._clock()
        self._on_saved()

    def last(self, name: str) -> Standing | None:
        """Where the chain stood when it was saved last; None where it never was."""
        for path in reversed(list(self._files(name))):
            try:
                return _read(path)
            except UNREADABLE as error:
                log.warning("%s is passed over: %s", path.name, error)
        return None

    def _save(self, name: str, standing: Standing) -> None:
        files = list(self._files(name))
        number = 1 + (int(files[-1].stem.rpartition("-")[2]) if files else 0)
        tree, arrays = packed(standing)
        text = json.dumps({"kernels": _kernels(), "state": tree}).encode()
        parts = {str(k): array for k, array in enumerate(arrays)}
        with replacing(self._folder / f"{name}-{number:06d}.npz") as partial, partial.open("wb") as file:
            np.savez(file, allow_pickle=False, json=np.frombuffer(text, np.uint8), **parts)
        for old in files[: 1 - KEPT]:
            old.unlink(missing_ok=True)

    def _files(self, name: str) -> Iterator[Path]:
        """The oldest first."""
        yield from sorted(self._folder.glob(f"{name}-??????.npz"))


def _kernels() -> str:
    return digest("bentray_kernels.tomography") + digest("bentray_kernels.wave")


def _read(path: Path) -> Standing:
    with PARSING, np.load(path, allow_pickle=False) as found:
        content = json.loads(bytes(found["json"]))
        if content["kernels"] != _kernels():
            raise ValueError("it is of another version of the kernels")
        return unpacked(content["state"], [found[str(k)] for k in range(len(found.files) - 1)], TYPES)
