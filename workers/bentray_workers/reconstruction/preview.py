"""The image of an unfinished reconstruction, from its newest checkpoint."""

import base64
import json
import math
import re
import zipfile
from pathlib import Path
from typing import IO, Any, NamedTuple, cast

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from bentray_kernels.arrays import Floats
from bentray_kernels.tomography.checkpoint import unpack
from bentray_kernels.tomography.reconstruction_graph import ReconstructionCheckpoint
from bentray_kernels.tomography.sart.sart_step import BlockCheckpoint
from bentray_kernels.tomography.waveform.inversion_state import RefinementCheckpoint
from bentray_kernels.tomography.waveform.waveform_checkpoint import TYPES

from ..cluster.checkpoints import UNREADABLE
from ..files.npy_headers import PARSING, read_header
from .blocks.block_files import BLOCKS, SLOWNESS, BlockFiles

# Nodes along a side; of more, every n-th is taken.
MAX_NODES = 256
# Of the text of a checkpoint: its records without arrays.
MAX_TEXT_BYTES = 2**26

# The name of a checkpoint: numbers of the group of graphs, of the graph in it (a slice or a candidate model),
# and of the file.
FILE = re.compile(r"(\d+)-(\d{5})-(\d{6})\.npz")


class _ImageSource(NamedTuple):
    """Where the image of a checkpoint is: number of its array, and whether that is the slowness, s/m.

    Its nodes are ``spacing`` apart, m; node 0 is at ``origin``, (x, y[, z]), m.
    """

    array: int
    slowness: bool
    stage: int
    iteration: int
    spacing: float
    origin: tuple[float, ...]


def checkpoint_image(folder: Path) -> dict[str, Any] | None:
    """The speed that the newest reconstruction of a job has reached, in the middle slice.

    Files are only read, a row of the image at a time, so that the job does not notice it.

    Args:
        folder: of the checkpoints of the job; it may be absent.

    Returns:
        JSON values: ``speed`` is base64 of float32, little endian, (nx, ny), m/s; ``every``: of the nodes
        along a side, each n-th is in it; ``spacing_m`` between these, and ``origin_m``, (x, y) of the first.
        None while there is no image.
    """
    named = [(match, path) for path in folder.glob("*.npz") if (match := FILE.fullmatch(path.name))]
    for group in sorted({int(match[1]) for match, _ in named}, reverse=True):
        of_group = [(int(match[2]), int(match[3]), path) for match, path in named if int(match[1]) == group]
        graphs = sorted({graph for graph, _, _ in of_group})
        # From the middle one outwards, and of each the newest file.
        middle = graphs[len(graphs) // 2]
        for graph, _, path in sorted(of_group, key=lambda row: (abs(row[0] - middle), row[0], -row[1])):
            try:
                image = _read(path)
            except UNREADABLE:
                # Replaced in the meantime, or of another version.
                continue
            if image is not None:
                return {**image, "reconstruction": group + 1, "part": graph + 1, "parts": len(graphs)}
    return None


def _read(path: Path) -> dict[str, Any] | None:
    with PARSING, zipfile.ZipFile(path) as archive:
        if archive.getinfo("json.npy").file_size > MAX_TEXT_BYTES:
            return None
        with archive.open("json.npy") as member:
            content = json.loads(bytes(npy.read_array(member, allow_pickle=False)))
        # Numbers in the place of the arrays.
        numbers = cast("list[NDArray[Any]]", range(len(archive.namelist()) - 1))
        checkpoint = unpack(content["state"], numbers, TYPES)
        slowness = _find_image(checkpoint)
        if slowness is None:
            return None
        if not isinstance(checkpoint, BlockCheckpoint):
            with archive.open(f"{slowness.array}.npy") as member:
                image, every = _middle_plane(member)
    if isinstance(checkpoint, BlockCheckpoint):
        # They are parsed by their own reader, one at a time too.
        files = BlockFiles(path.parent.parent / BLOCKS, (checkpoint.nodes,), checkpoint.blocks)
        image, every = files.middle_plane(files.state(checkpoint.updates), SLOWNESS, MAX_NODES)
    speed = 1.0 / image if slowness.slowness else image
    return {
        "shape": list(speed.shape),
        "every": every,
        "speed": base64.b64encode(speed.astype("<f4").tobytes()).decode(),
        "range_mps": [float(speed.min()), float(speed.max())],
        "spacing_m": [every * slowness.spacing] * 2,
        "origin_m": list(slowness.origin[:2]),
        "stage": slowness.stage + 1,
        "iteration": slowness.iteration,
    }


def _find_image(checkpoint: Any) -> _ImageSource | None:
    if isinstance(checkpoint, ReconstructionCheckpoint):
        state = checkpoint.state
        grid = checkpoint.spacing, checkpoint.origin
        return _ImageSource(cast(int, state.slowness), True, checkpoint.stage, state.iteration, *grid)
    if isinstance(checkpoint, BlockCheckpoint) and checkpoint.updates:
        # Its images are in files of their own.
        return _ImageSource(0, True, 0, checkpoint.state.iteration, checkpoint.spacing, checkpoint.origin)
    if isinstance(checkpoint, RefinementCheckpoint):
        band, ends = checkpoint.band, checkpoint.ends
        if band is not None and band.frozen is None:
            grid = band.spacing, band.origin
            return _ImageSource(
                cast(int, band.state.accepted_image), False, len(ends), len(band.state.history), *grid
            )
        if ends:
            image, iteration = ends[-1].image, len(ends[-1].history)
            grid = image.spacing, image.origin
            return _ImageSource(cast(int, image.speed), False, len(ends) - 1, iteration, *grid)
    return None


def _middle_plane(member: IO[bytes]) -> tuple[Floats, int]:
    """The plane across the third axis in its middle, at ``MAX_NODES`` or fewer, and the step of its nodes.

    Raises:
        ValueError: for an array that is no image.
    """
    shape, fortran, dtype = read_header(member)
    if len(shape) not in (2, 3) or dtype.kind != "f" or 0 in shape:
        raise ValueError(f"an image, not an array of shape {shape} and type {dtype}")
    every = math.ceil(max(shape[:2]) / MAX_NODES)
    # In the order of the file; its first axis is read one by one.
    stored = shape[::-1] if fortran else shape
    middle, rows = shape[-1] // 2, []
    for index in range(stored[0]):
        block = np.frombuffer(member.read(dtype.itemsize * math.prod(stored[1:])), dtype).reshape(stored[1:])
        if len(shape) == 3 and fortran:
            if index == middle:
                rows = list(block[::every, ::every])
        elif index % every == 0:
            rows.append(block[::every] if len(shape) == 2 else block[::every, middle])
    image = np.array(rows, dtype=np.float64)
    return image.T if fortran else image, every
