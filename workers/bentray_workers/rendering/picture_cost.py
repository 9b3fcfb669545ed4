"""Cost of a picture, estimated before it starts: CPU time and memory, checked against the workers.

Seconds are typical for a core of 2023: rough volumes take several times as long. Bytes are an upper bound,
compared with peaks in ``tests/workers/rendering/test_picture_cost.py`` and ``bentray bench task_memory``.
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
from ..files.quantities import IMAGES
from .field_tasks import FACE_BYTES
from .field_view import FieldView
from .isosurface_mesh import MAX_CROSSINGS
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

# Per pixel drawn and compressed by Matplotlib: measured 29 with a frame, 42 without; of a page of quality.
DRAWN_BYTES, DRAWN_S = 46, 2e-7
PAGE_BYTES = 40 * MIB
# Sides of a picture without a given size, pixels.
USUAL_SIZE = 1200

# All images of a reconstruction are read, float64 each (measured: 42 to 46 bytes a node); a volume is float32
# at most. Masks of finite values take a byte of a node.
REAL, RECONSTRUCTION_MASKS, MASKS = 8, 4, 1
READ_S = 2e-9

# Measured with up to 380³ nodes: of any file that is read; per node while a volume is filtered; of a mesh,
# per node of its grid and per cut edge (325 MiB for 74,896 edges in 120³ nodes).
FILE_BYTES = 20 * MIB
FILTER_BYTES, MESHED_BYTES, CROSSING_BYTES = 26, 17, 4600

# Of a geometry field: per camera ray, and per surface at which it may continue (twice with exact lookups).
# Measured: 0.3 to 2.4 us per ray at depths to 16, of which most rays need few; 22 us for glass that fills the
# picture.
FIELD_RAY_S, FIELD_SURFACE_S = 1e-6, 3e-7
# To sort a face of the mesh, once on each worker; measured 3.4 s for 980,000.
FACE_S = 3.5e-6
SCENE_BYTES = 36 * MIB

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


def filter_cost(stored: VolumeFile) -> Cost:
    """Cost of a filtered volume as float32, or of a histogram, whose values have a filter of a picture."""
    nodes = math.prod(stored.shape)
    needed = FLOOR_BYTES + max(stored.read_bytes, needed_bytes(stored.shape, FILTER_BYTES))
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
    faces = int(figures.get("faces", 0))
    surface = 2 * FACE_BYTES * faces + 24 * int(figures.get("image_pixels", 0)) ** 2
    # One byte per eight entries of the outer table marks equal entries.
    needed = SCENE_BYTES + tables + tables // 8 + surface
    if view.reads_image:
        # As many bytes of (u, v) as of the outer table, and the image, once more while they are made.
        needed += 2 * (int(figures.get("outer_bytes", 0)) + 24 * int(figures.get("image_pixels", 0)) ** 2)
    return Cost(FLOOR_SECONDS + FACE_S * faces + rays * ray_s, _tile_bytes(view) + needed)


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
    return Cost(seconds, FLOOR_BYTES + PAGE_BYTES + emission + 256 * pairs)


def geometry_cost(dataset: Mapping[str, Any]) -> Cost:
    """Cost of reading a scan without its traces."""
    pairs = int(dataset["ntx"]) * int(dataset["nrx"]) * int(dataset["slices"])
    return Cost(FLOOR_SECONDS + 1e-7 * pairs, FILE_BYTES + 64 * pairs)


def emission_cost(dataset: Mapping[str, Any]) -> Cost:
    """Cost of the traces of one emission, of which the chunks that hold it are read."""
    whole = geometry_cost(dataset)
    emission = int(dataset["bytes"]) // max(1, int(dataset["ntx"]) * int(dataset["slices"]))
    return Cost(whole.seconds + emission / TRACE_BYTES_PER_S, whole.bytes + 2 * BLOCK_BYTES + 16 * emission)


def mesh_cost(stored: VolumeFile, step: int) -> Cost:
    """Cost of the iso-surface of a volume as a mesh, at most as large as ``isosurface_mesh`` allows."""
    nodes = math.prod(stored.shape)
    used = math.prod(-(-n // step) for n in stored.shape)
    surface = max(MESHED_BYTES * used, CROSSING_BYTES * min(MAX_CROSSINGS, len(stored.shape) * used))
    return Cost(4.0 + 3e-8 * nodes, FLOOR_BYTES + stored.read_bytes + surface)


def export_cost(stored: VolumeFile, name: FormatName) -> Cost:
    """Cost of an export to one of ``EXPORTED``: the volume is read whole, and images copied to write them."""
    written = EXPORTED[name]
    copied = written.copies * stored.value_bytes * (stored.images if written.copies_all else 1)
    needed = FILE_BYTES + written.library_bytes + stored.read_bytes + copied * math.prod(stored.shape)
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
        value_bytes: of a node of one image.
        images: their number; more than one of a reconstruction.
    """

    shape: tuple[int, ...]
    value_bytes: int
    images: int = 1

    @classmethod
    def from_row(cls, row: Mapping[str, Any]) -> VolumeFile:
        """From a row of ``volumes`` or ``uploaded_volumes``."""
        shape = tuple(row["shape"])
        if "job_id" in row:
            return cls(shape, REAL, len(IMAGES))
        # The values are not compressed.
        return cls(shape, max(1, min(4, int(row["bytes"]) // math.prod(shape))))

    @property
    def read_bytes(self) -> int:
        """Memory of the whole file."""
        masks = MASKS if self.images == 1 else RECONSTRUCTION_MASKS
        return math.prod(self.shape) * (self.images * self.value_bytes + masks)


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
    # At least one row, and three more of rays on each side, from which edges of glass are smoothed.
    row = view.width * view.times**2
    rays = min(_rays(view), max(TASK_RAYS, row)) + 2 * -(-3 // view.times) * row
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
