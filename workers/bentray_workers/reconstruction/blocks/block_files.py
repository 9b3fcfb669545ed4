"""Arrays of a volume in blocks of planes of x: one file for each block, in the folder of the job."""

import math
import os
import secrets
import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bentray_kernels.arrays import Floats
from bentray_kernels.rays.block_tracing import BlockPlanes

from ...files.atomic import atomic_replace
from ...files.npy_headers import read_header

# Folder of the files in that of the job.
BLOCKS = "blocks"

# Names of the state after each update, and of the nodes that may change.
SLOWNESS, COVERAGE, REGION = "slowness", "coverage", "region"


class BlockFiles(NamedTuple):
    """Where tasks find the arrays of blocks. Files are never changed, so that a task may run twice.

    The state after update n is in ``state-n``; what its tasks leave for each other is in ``scratch-n``.

    Attributes:
        folder: every worker can read and write it.
        shape: (nx, ny, nz) of the volume, or (nx,) where only planes are read.
        blocks: their number.
    """

    folder: Path
    shape: tuple[int, ...]
    blocks: int

    def planes(self, block: int) -> BlockPlanes:
        """Planes of a block, and of its neighbours that it needs."""
        start, stop = self.bounds(block)
        return BlockPlanes.from_range(start, stop, self.shape[0])

    def bounds(self, block: int) -> tuple[int, int]:
        """First plane of a block, and the one behind its last."""
        nodes = self.shape[0]
        return nodes * block // self.blocks, nodes * (block + 1) // self.blocks

    def block_of(self, plane: float) -> int:
        """The block of a place along x, nodes."""
        return next(b for b in reversed(range(self.blocks)) if b == 0 or self.bounds(b)[0] <= plane)

    def state(self, update: int) -> Path:
        return self.folder / f"state-{update:07d}"

    def scratch(self, update: int) -> Path:
        return self.folder / f"scratch-{update:07d}"

    def begin(self, update: int) -> None:
        """Make the folders of an update; what an interrupted one has left is removed."""
        shutil.rmtree(self.scratch(update), ignore_errors=True)
        self.scratch(update).mkdir(parents=True)
        self.state(update + 1).mkdir(parents=True, exist_ok=True)

    def finish(self, update: int) -> None:
        """Remove what is not needed after an update; the state before it remains too, see ``Checkpoints``."""
        shutil.rmtree(self.scratch(update), ignore_errors=True)
        shutil.rmtree(self.state(update - 1), ignore_errors=True)

    def complete(self, update: int) -> bool:
        """Whether the state after an update is there."""
        names = [file_name(name, block) for name in (SLOWNESS, COVERAGE) for block in range(self.blocks)]
        return all((self.state(update) / name).exists() for name in names)

    def read(
        self,
        folder: Path,
        name: str | Sequence[str],
        low: int = 0,
        high: int | None = None,
        kind: type = np.float64,
    ) -> NDArray[Any]:
        """Planes [low, high) of an array, from the files of the blocks that hold them.

        Args:
            folder, name: of the files; one name, or that of each block.
            low, high: planes of the volume; None: to the last.
            kind: type of the numbers.
        """
        high = self.shape[0] if high is None else high
        planes: NDArray[Any] = np.empty((high - low, *self.shape[1:]), kind)
        for block in range(self.blocks):
            start, stop = self.bounds(block)
            first, last = max(low, start), min(high, stop)
            if first < last:
                own = name if isinstance(name, str) else name[block]
                path = folder / file_name(own, block)
                planes[first - low : last - low] = read_planes(path, first - start, last - start)
        return planes

    def middle_plane(self, folder: Path, name: str, most: int) -> tuple[Floats, int]:
        """The plane across z in its middle, every n-th node along x and y, and n.

        Args:
            folder, name: as for ``read``.
            most: nodes along x and y.
        """
        rows, every = [], 1
        for block in range(self.blocks):
            start, stop = self.bounds(block)
            path = folder / file_name(name, block)
            if not block:
                every = math.ceil(max(self.shape[0], *read_planes(path, 0, 1).shape[1:2]) / most)
            for plane in range(start + -start % every, stop, every):
                plane_values = read_planes(path, plane - start, plane - start + 1)[0]
                rows.append(plane_values[::every, plane_values.shape[1] // 2])
        return np.array(rows), every


def file_name(name: str, block: int) -> str:
    return f"{name}-{block:04d}.npy"


def write_array(path: Path, array: NDArray[Any], *, lasting: bool = False) -> None:
    """Write a file under another name first, so that it is complete or absent.

    Args:
        path: of the file.
        array: of numbers.
        lasting: whether it must survive a crash of the machine.
    """
    if lasting:
        with atomic_replace(path) as partial, partial.open("wb") as file:
            np.save(file, array, allow_pickle=False)
        return
    partial = path.with_name(f"{path.name}.{secrets.token_hex(4)}.partial")
    with partial.open("wb") as file:
        np.save(file, array, allow_pickle=False)
    partial.replace(path)


def read_planes(path: Path, low: int = 0, high: int | None = None) -> NDArray[Any]:
    """Entries [low, high) of the first axis of a file. A memory map would count as memory of the worker.

    Raises:
        OSError, ValueError: for a file that ``write_array`` has not written.
    """
    with path.open("rb") as file:
        shape, fortran, dtype = read_header(file)
        if fortran:
            raise ValueError(f"{path}: an array in C order")
        planes: NDArray[Any] = np.empty(((shape[0] if high is None else high) - low, *shape[1:]), dtype)
        file.seek(low * (planes.nbytes // max(1, len(planes))), os.SEEK_CUR)
        if file.readinto(planes.data) != planes.nbytes:
            raise ValueError(f"{path}: shorter than its header says")
    return planes


def write_first(files: BlockFiles, slowness: Floats | float, region: NDArray[np.bool_]) -> None:
    """Write the state before the first update.

    Args:
        files: of the volume.
        slowness: of the volume, or of all its nodes, s/m.
        region: as ``slowness``, nodes that may change.
    """
    shutil.rmtree(files.folder, ignore_errors=True)
    files.state(0).mkdir(parents=True)
    for block in range(files.blocks):
        start, stop = files.bounds(block)
        own = np.full((stop - start, *files.shape[1:]), slowness) if np.isscalar(slowness) else None
        if own is None:
            own = np.ascontiguousarray(np.asarray(slowness)[start:stop])
        write_array(files.state(0) / file_name(SLOWNESS, block), own, lasting=True)
        write_array(files.state(0) / file_name(COVERAGE, block), np.zeros_like(own), lasting=True)
        write_array(files.folder / file_name(REGION, block), region[start:stop], lasting=True)
