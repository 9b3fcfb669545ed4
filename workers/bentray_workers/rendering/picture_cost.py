"""Cost of a picture, estimated before it starts: CPU time and memory, checked against the workers.

Seconds are typical for a core of 2023: rough volumes take several times as long. Bytes are an upper bound,
compared with measured peaks in ``tests/workers/rendering/test_picture_cost.py``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from bentray_kernels.errors import InvalidInput

from ..cluster.capacities import MIB, WorkerCapacity
from ..cluster.resources import RECONSTRUCTION, RENDER
from ..files.dataset.counts import BLOCK_BYTES
from ..files.export.registry import EXPORTED, FormatName
from .field_tasks import FACE_BYTES
from .field_view import FieldView
from .refraction_view import RefractionView
from .scene_cache import BUILDING_BYTES, needed_bytes
from .tiles import TASK_RAYS

# Of one interactive picture, s; longer ones need a job.
MAX_SECONDS = 60.0

# Part of the memory of a worker for a picture beside a task of a job, and for a frame beside both. Jobs are
# planned for 80 % of it less that of a warm worker, which has a margin of MARGIN_BYTES, a short one for 5 %
# beside them, and Dask kills a worker at 95 %.
BESIDE_PART = 0.04
MARGIN_BYTES = 96 * MIB

# Overhead of Python and Matplotlib.
FLOOR_BYTES, FLOOR_SECONDS = 48 * MIB, 0.3

# Per ray of a tile, and per pixel of a picture while tiles are stacked and compressed.
RAY_BYTES, PIXEL_BYTES = 160, 8
RAY_S, SURFACE_S = 6e-7, 1.5e-7
SMOOTH_SCENE_S = 2.5e-7

# Per pixel drawn and compressed by Matplotlib.
DRAWN_BYTES, DRAWN_S = 56, 2e-7
# Sides of a picture without a given size, pixels.
USUAL_SIZE = 1200

# A reconstruction has four images at most, float64 each, and is read whole; a volume float32 at most.
IMAGES, REAL = 4, 8
READ_S = 2e-9

# Of a geometry field: per camera ray, and per surface at which it may continue (twice with exact lookups).
# Measured: 0.3 to 2.4 us per ray at depths to 16, of which most rays need few; 22 us for glass that fills the
# picture.
FIELD_RAY_S, FIELD_SURFACE_S = 1e-6, 3e-7
SCENE_BYTES = 96 * MIB

# Bytes of traces that a core examines in a second.
TRACE_BYTES_PER_S = 2**25


@dataclass(frozen=True)
class Cost:
    """Cost of one picture.

    Attributes:
        seconds: estimated CPU time.
        bytes: memory of its largest task.
    """

    seconds: float
    bytes: int


def slice_cost(stored: VolumeFile, size: int | None) -> Cost:
    """Cost of a slice of a volume; ``size`` as in ``images.slice_style.SliceStyle``."""
    pixels = (size or USUAL_SIZE) ** 2
    seconds = FLOOR_SECONDS + READ_S * stored.read_bytes + DRAWN_S * pixels
    return Cost(seconds, FLOOR_BYTES + stored.read_bytes + DRAWN_BYTES * pixels)


def refraction_cost(stored: VolumeFile, view: RefractionView) -> Cost:
    """Cost of a refractive rendering of a volume.

    Raises:
        InvalidInput: for a picture that takes more than ``MAX_SECONDS``.
    """
    scene, rays = refraction_seconds(stored.shape, view)
    _check_seconds(
        "width, height, depth",
        f"{view.width} x {view.height} pixels of {view.times**2} rays and depth {_depth(view)}",
        rays,
        view.width,
        view.height,
        ", or submit a job of kind `refraction` (frames: 1)",
    )
    return Cost(scene + rays, refraction_bytes(stored.shape, view))


def refraction_seconds(shape: Sequence[int], view: RefractionView) -> tuple[float, float]:
    """CPU time to filter the volume, once on each worker, and of the rays of one picture, s."""
    spacing = view.ray_spacing if view.mode == "refract" else 1
    # Filters of a higher degree use more nodes per value.
    order = int(view.filter[-1]) if view.filter.startswith("bspline") else 3
    ray_s = (RAY_S + SURFACE_S * _depth(view)) * (1.0 + 0.5 * max(0, order - 3))
    return FLOOR_SECONDS + SMOOTH_SCENE_S * math.prod(shape), _rays(view) // spacing**2 * ray_s


def _depth(view: RefractionView) -> int:
    """Largest number of surfaces on a ray; a lit surface is the only one."""
    return 1 if view.mode == "shaded" else view.depth


def refraction_bytes(shape: Sequence[int], view: RefractionView) -> int:
    """Memory of a task of that picture; reading the volume takes less than its scene."""
    return _tile_bytes(view) + needed_bytes(shape, BUILDING_BYTES)


def histogram_cost(stored: VolumeFile) -> Cost:
    """Cost of a histogram of a volume, with the filter of a picture of it."""
    filtered = needed_bytes(stored.shape, BUILDING_BYTES) if len(stored.shape) == 3 else 0
    # NumPy converts pieces of the values; the mean and deviation take one copy in float64.
    needed = FLOOR_BYTES + stored.read_bytes + max(REAL * math.prod(stored.shape), filtered)
    return Cost(FLOOR_SECONDS + (READ_S + SMOOTH_SCENE_S) * math.prod(stored.shape), needed)


def coefficients_cost(stored: VolumeFile) -> Cost:
    """Cost of a filtered volume, sent as float32: one array and its file."""
    nodes = math.prod(stored.shape)
    needed = FLOOR_BYTES + stored.read_bytes + needed_bytes(stored.shape, BUILDING_BYTES + REAL)
    return Cost(FLOOR_SECONDS + (READ_S + SMOOTH_SCENE_S) * nodes, needed)


def field_cost(figures: Mapping[str, Any], view: FieldView) -> Cost:
    """Cost of a scene with a geometry field with the sizes in ``figures``.

    Raises:
        InvalidInput: for a picture that takes more than ``MAX_SECONDS``.
    """
    rays = _rays(view)
    ray_s = FIELD_RAY_S + FIELD_SURFACE_S * view.depth * (2 if view.lookup == "exact" else 1)
    _check_seconds(
        "width, height, rays, depth",
        f"{view.width} x {view.height} pixels of {view.rays**2} rays and depth {view.depth}",
        rays * ray_s,
        view.width,
        view.height,
        ", or a smaller depth",
    )
    tables = sum(int(figures.get(name, 0)) for name in ("outer_bytes", "inner_bytes"))
    surface = 2 * FACE_BYTES * int(figures.get("faces", 0)) + 24 * int(figures.get("image_pixels", 0)) ** 2
    # One byte per eight entries of the outer table marks equal entries.
    needed = SCENE_BYTES + tables + tables // 8 + surface
    if view.reads_image:
        # As many bytes of (u, v) as of the outer table, and the image, once more while they are made.
        needed += 2 * (int(figures.get("outer_bytes", 0)) + 24 * int(figures.get("image_pixels", 0)) ** 2)
    return Cost(FLOOR_SECONDS + rays * ray_s, _tile_bytes(view) + needed)


def map_cost(figures: Mapping[str, Any]) -> Cost:
    """Cost of a geometry image or a normal map."""
    pixels = int(figures.get("image_pixels", 0)) ** 2
    return Cost(FLOOR_SECONDS + DRAWN_S * pixels, FLOOR_BYTES + 96 * pixels)


def quality_cost(dataset: Mapping[str, Any]) -> Cost:
    """Cost of the examination of a scan with the counts in its row."""
    pairs = int(dataset["ntx"]) * int(dataset["nrx"]) * int(dataset["slices"])
    traces = int(dataset["bytes"]) if dataset["has_traces"] else 0
    # Traces of one emission of object and water at a time, with a few copies.
    emission = 16 * traces // max(1, int(dataset["ntx"]) * int(dataset["slices"]))
    seconds = 1.0 + traces / TRACE_BYTES_PER_S + 2e-6 * pairs
    return Cost(seconds, 2 * FLOOR_BYTES + DRAWN_BYTES * USUAL_SIZE**2 + emission + 256 * pairs)


def geometry_cost(dataset: Mapping[str, Any]) -> Cost:
    """Cost of reading a scan without its traces."""
    pairs = int(dataset["ntx"]) * int(dataset["nrx"]) * int(dataset["slices"])
    return Cost(FLOOR_SECONDS + 1e-7 * pairs, FLOOR_BYTES + 64 * pairs)


def emission_cost(dataset: Mapping[str, Any]) -> Cost:
    """Cost of the traces of one emission, of which the chunks that hold it are read."""
    whole = geometry_cost(dataset)
    emission = int(dataset["bytes"]) // max(1, int(dataset["ntx"]) * int(dataset["slices"]))
    return Cost(whole.seconds + emission / TRACE_BYTES_PER_S, whole.bytes + 2 * BLOCK_BYTES + 16 * emission)


def mesh_cost(stored: VolumeFile) -> Cost:
    """Cost of the iso-surface of a volume as a mesh."""
    nodes = math.prod(stored.shape)
    return Cost(4.0 + 3e-8 * nodes, 4 * FLOOR_BYTES + stored.read_bytes + 16 * nodes)


def export_cost(stored: VolumeFile, name: FormatName) -> Cost:
    """Cost of an export to one of ``EXPORTED``: the volume is read whole, and copied to write it."""
    written = EXPORTED[name]
    needed = FLOOR_BYTES + written.library_bytes + int(written.copies * stored.read_bytes)
    return Cost(FLOOR_SECONDS + 4 * READ_S * stored.read_bytes, needed)


def truth_cost(stored: VolumeFile, dataset: Mapping[str, Any]) -> Cost:
    """Cost of a comparison with the truth: the volume, and the scan without its traces, are read whole."""
    scan = 256 * int(dataset["ntx"]) * int(dataset["nrx"]) * int(dataset["slices"])
    # Without traces the file is mostly the truth, which may be compressed to a tenth.
    truth = 0 if dataset["has_traces"] else 10 * int(dataset["bytes"])
    reading = Cost(1.0 + 8 * READ_S * stored.read_bytes, 2 * FLOOR_BYTES + 3 * stored.read_bytes)
    return Cost(reading.seconds, reading.bytes + scan + truth)


@dataclass(frozen=True)
class VolumeFile:
    """The file of a volume, by its row.

    Attributes:
        shape: (nx, ny[, nz]).
        node_bytes: memory per node when it is read.
    """

    shape: tuple[int, ...]
    node_bytes: int

    @classmethod
    def from_row(cls, row: Mapping[str, Any]) -> VolumeFile:
        """From a row of ``volumes`` or ``uploaded_volumes``."""
        nodes = math.prod(row["shape"])
        if "job_id" in row:
            # Read, and converted to float64.
            return cls(tuple(row["shape"]), (IMAGES + 1) * REAL)
        # The values are not compressed; a mask of finite values takes a byte each.
        return cls(tuple(row["shape"]), 2 + max(1, min(4, int(row["bytes"]) // nodes)))

    @property
    def read_bytes(self) -> int:
        """Memory of the whole file."""
        return math.prod(self.shape) * self.node_bytes


def spare_bytes(capacity: WorkerCapacity) -> float:
    """Memory for a picture on a worker that runs a job; larger pictures need the worker alone."""
    return MARGIN_BYTES + BESIDE_PART * capacity.memory_bytes if capacity.memory_bytes else math.inf


def placed(
    size: int, workers: Mapping[str, WorkerCapacity], lane: Mapping[str, int] = RENDER
) -> dict[str, Any]:
    """Placement of tasks by their memory, for ``Client.submit``.

    Args:
        size: of each task, bytes.
        workers: by address.
        lane: resource of the tasks.

    Returns:
        Resources, and the addresses of able workers unless all are.
    """
    able = {address: capacity for address, capacity in workers.items() if capacity.task_bytes >= size}
    alone = any(size > spare_bytes(capacity) and "recon" in capacity.resources for capacity in able.values())
    placement: dict[str, Any] = {"resources": {**lane, **RECONSTRUCTION} if alone else lane}
    return placement if len(able) in (0, len(workers)) else {**placement, "workers": list(able)}


def check_memory(field: str, what: str, cost: Cost, capacities: Sequence[WorkerCapacity]) -> None:
    """Reject a picture that no connected worker can draw; without workers nothing is checked.

    Raises:
        InvalidInput: naming ``field``, with the bytes found and accepted.
    """
    limit = max((capacity.task_bytes for capacity in capacities), default=math.inf)
    if cost.bytes > limit:
        given = f"{what}, which takes {cost.bytes} bytes of a worker"
        accepted = f"at most {limit:.0f} bytes, or a worker with more memory"
        raise InvalidInput(field, given, accepted)


def _rays(view: RefractionView | FieldView) -> int:
    return view.width * view.height * view.times**2


def _tile_bytes(view: RefractionView | FieldView) -> int:
    """Memory of a tile, or of the whole picture while its tiles are stacked."""
    # At least one row, and one more on each side for post-refraction supersampling.
    rays = min(_rays(view), max(TASK_RAYS, view.width * view.times**2)) + 2 * view.width * view.times**2
    return FLOOR_BYTES + max(RAY_BYTES * rays, PIXEL_BYTES * view.width * view.height)


def _check_seconds(field: str, given: str, seconds: float, width: int, height: int, alternative: str) -> None:
    if seconds > MAX_SECONDS:
        shrink = math.sqrt(MAX_SECONDS / seconds)
        largest = f"{max(1, int(width * shrink))} x {max(1, int(height * shrink))} pixels of these"
        raise InvalidInput(
            field,
            f"{given}: about {seconds:.0f} s of a core",
            f"at most {MAX_SECONDS:g} s, as {largest}{alternative}",
        )
