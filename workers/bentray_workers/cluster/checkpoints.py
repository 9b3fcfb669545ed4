"""Checkpoints of one job: the states of its task graphs in files with check sums."""

import json
import logging
import time
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from bentray_kernels.compilation.sources import digest
from bentray_kernels.task_graph import Checkpoint
from bentray_kernels.tomography.checkpoint import pack, unpack
from bentray_kernels.tomography.reflection.reflection_graph import RECORDS
from bentray_kernels.tomography.waveform.waveform_checkpoint import TYPES

from ..files.atomic import atomic_replace
from ..files.npy_headers import PARSING

log = logging.getLogger("bentray.checkpoints")

# Within an iteration the state is saved this often, s; each finished iteration is saved at once.
INTERVAL_S = 5.0

# Files of each graph: the newest, and the one before it in case the newest is damaged.
KEPT = 2

# Records in checkpoints of all kinds, by name.
ALL_TYPES = {**TYPES, **{record.__name__: record for record in RECORDS}}

# What a damaged file, or one of another version, may raise.
UNREADABLE = (OSError, ValueError, KeyError, TypeError, IndexError, EOFError, zipfile.BadZipFile)


class Checkpoints:
    """The files of one job in one folder, ``NAME-GENERATION.npz``.

    A file is written under another name, synchronised to the disk and then renamed. The zip format holds a
    check sum of every part, so damaged files are detected. A checkpoint of another version of the kernels is
    not used: the result would be of neither version.

    Args:
        folder: of this job alone; created if missing.
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
        self._saved: dict[str, tuple[Checkpoint, float]] = {}
        folder.mkdir(parents=True, exist_ok=True)

    def save(self, name: str, checkpoint: Checkpoint) -> None:
        """Save the state of a graph, unless it has hardly changed since it was saved last.

        Raises:
            OSError: where the file cannot be written; the ones before it remain.
        """
        if name in self._saved:
            before, when = self._saved[name]
            # Rows of an unfinished iteration do not change the state; batches of a long SART iteration do.
            changed = before.state is not checkpoint.state and self._clock() - when >= INTERVAL_S
            if before.milestone == checkpoint.milestone and not changed:
                return
        self._write(name, checkpoint)
        self._saved[name] = checkpoint, self._clock()
        self._on_saved()

    def load(self, name: str) -> Checkpoint | None:
        """The state that was saved last; None if there is none."""
        for path in reversed(list(self._files(name))):
            try:
                return _read(path)
            except UNREADABLE as error:
                log.warning("checkpoint %s is not used: %s", path.name, error)
        return None

    def _write(self, name: str, checkpoint: Checkpoint) -> None:
        files = list(self._files(name))
        number = 1 + (int(files[-1].stem.rpartition("-")[2]) if files else 0)
        tree, arrays = pack(checkpoint)
        text = json.dumps({"kernels": _kernels(), "state": tree}).encode()
        numbered = {str(k): array for k, array in enumerate(arrays)}
        with atomic_replace(self._folder / f"{name}-{number:06d}.npz") as partial, partial.open("wb") as file:
            np.savez(file, allow_pickle=False, json=np.frombuffer(text, np.uint8), **numbered)
        for old in files[: 1 - KEPT]:
            old.unlink(missing_ok=True)

    def _files(self, name: str) -> Iterator[Path]:
        """The oldest first."""
        yield from sorted(self._folder.glob(f"{name}-??????.npz"))


def _kernels() -> str:
    return digest("bentray_kernels.tomography") + digest("bentray_kernels.wave")


def _read(path: Path) -> Checkpoint:
    with PARSING, np.load(path, allow_pickle=False) as archive:
        content = json.loads(bytes(archive["json"]))
        if content["kernels"] != _kernels():
            raise ValueError("it is of another version of the kernels")
        return unpack(content["state"], [archive[str(k)] for k in range(len(archive.files) - 1)], ALL_TYPES)
