"""Cost of a picture, estimated before it starts: CPU time and memory, checked against the workers.

Both are from the table of task costs, but for the CPU time of rays: no fit can hold, since nobody knows
before how many surfaces they meet. The speeds here are typical for a core of 2023; rough volumes take several
times as long.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from bentray_kernels.errors import InvalidInput

from ..cluster.capacities import MIB, REAL, WorkerCapacity
from ..cluster.resources import RECONSTRUCTION, RENDER
from ..cluster.task_costs import TaskSize
from ..files.dataset.counts import BLOCK_BYTES
from ..files.export.registry import FormatName
from .field_view import FieldView
from .refraction_view import RefractionView
from .scene_cache import padded_nodes
from .tiles import TASK_RAYS

# Of one interactive picture, s; longer ones need a job.
MAX_SECONDS = 60.0

# Part of the memory of a worker for a picture beside a task of a job. Jobs are planned for 80 % of it less
# that of a warm worker, which has a margin of MARGIN_BYTES, and Dask kills a worker at 95 %.
BESIDE_PART = 0.05
MARGIN_BYTES = 96 * MIB

# Of any picture, per ray and per surface on it, and per node of a volume that is filtered.
FLOOR_S, RAY_S, SURFACE_S, SMOOTH_SCENE_S = 0.3, 6e-7, 1.5e-7, 2.5e-7
# Of a geometry field: per camera ray, and per surface at which it may continue (twice with exact lookups).
# Measured: 0.3 to 2.4 us per ray at depths to 16, of which most rays need few; 22 us for glass that fills the
# picture.
FIELD_RAY_S, FIELD_SURFACE_S = 1e-6, 3e-7

# Sides of a picture without a given size, pixels.
USUAL_SIZE = 1200

# A reconstruction has four images at most, float64 each, and is read whole; a volume float32 at most.
IMAGES = 4


class Cost(NamedTuple):
    """Cost of one picture.

    Attributes:
        size: its largest task.
        rays_s: CPU time of a picture of rays; None for others.
    """

    size: TaskSize
    rays_s: float | None = None

    @property
    def seconds(self) -> float:
        """Estimated CPU time."""
        return self.size.seconds if self.rays_s is None else self.rays_s

    @property
    def bytes(self) -> int:
        """Memory of its largest task."""
        return self.size.bytes


def slice_cost(stored: VolumeFile, size: int | None) -> Cost:
    """Cost of a slice of a volume; ``size`` as in ``images.slice_style.SliceStyle``."""
    counts = {"bytes of the volume": stored.read_bytes, "pixels": (size or USUAL_SIZE) ** 2}
    return Cost(TaskSize("slice", counts))


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
    return Cost(largest(refraction_size(stored.shape, view), view), scene + rays)


def refraction_seconds(shape: Sequence[int], view: RefractionView) -> tuple[float, float]:
    """CPU time to filter the volume, once on each worker, and of the rays of one picture, s."""
    spacing = view.ray_spacing if view.mode == "refract" else 1
    # Filters of a higher degree use more nodes per value.
    order = int(view.filter[-1]) if view.filter.startswith("bspline") else 3
    ray_s = (RAY_S + SURFACE_S * _depth(view)) * (1.0 + 0.5 * max(0, order - 3))
    return FLOOR_S + SMOOTH_SCENE_S * math.prod(shape), _rays(view) // spacing**2 * ray_s


def _depth(view: RefractionView) -> int:
    """Largest number of surfaces on a ray; a lit surface is the only one."""
    return 1 if view.mode == "shaded" else view.depth


def largest(tile: TaskSize, view: RefractionView | FieldView) -> TaskSize:
    """The larger of a tile, and of the task that stacks all of them."""
    return max(tile, stacking_size(view), key=lambda size: size.bytes)


def stacking_size(view: RefractionView | FieldView) -> TaskSize:
    """The whole picture, while its tiles are stacked and compressed."""
    return TaskSize("stacking", {"pixels": view.width * view.height})


def refraction_size(shape: Sequence[int], view: RefractionView) -> TaskSize:
    """A tile of that picture."""
    return TaskSize("refraction", {"filtered nodes": padded_nodes(shape), **_tile(view)})


def histogram_cost(stored: VolumeFile) -> Cost:
    """Cost of a histogram of a volume, with the filter of a picture of it."""
    filtered = padded_nodes(stored.shape) if len(stored.shape) == 3 else 0
    return Cost(TaskSize("histogram", {**_read(stored), "filtered nodes": filtered}))


def coefficients_cost(stored: VolumeFile) -> Cost:
    """Cost of a filtered volume, sent as float32: one array and its file."""
    return Cost(TaskSize("coefficients", {**_read(stored), "filtered nodes": padded_nodes(stored.shape)}))


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
    return Cost(largest(field_size(figures, view), view), FLOOR_S + rays * ray_s)


def field_size(figures: Mapping[str, Any], view: FieldView) -> TaskSize:
    """A tile of a scene with a geometry field."""
    tables, pixels = int(figures.get("outer_bytes", 0)), int(figures.get("image_pixels", 0)) ** 2
    counts = {
        "bytes of outer tables": tables,
        "bytes of inner tables": int(figures.get("inner_bytes", 0)),
        "faces": int(figures.get("faces", 0)),
        "pixels of the image": pixels,
        # The tables that such a view reads are made from the image.
        "bytes of made tables": tables if view.reads_image else 0,
        "pixels of the made image": pixels if view.reads_image else 0,
    }
    return TaskSize("geometry field", {**counts, **_tile(view)})


def map_cost(figures: Mapping[str, Any]) -> Cost:
    """Cost of a geometry image or a normal map."""
    return Cost(TaskSize("map", {"pixels": int(figures.get("image_pixels", 0)) ** 2}))


def quality_cost(dataset: Mapping[str, Any]) -> Cost:
    """Cost of the examination of a scan with the counts in its row."""
    return Cost(TaskSize("quality", _scan(dataset)))


def geometry_cost(dataset: Mapping[str, Any]) -> Cost:
    """Cost of reading a scan without its traces."""
    return Cost(TaskSize("geometry", _scan(dataset)))


def emission_cost(dataset: Mapping[str, Any]) -> Cost:
    """Cost of the traces of one emission, of which the chunks that hold it are read."""
    return Cost(TaskSize("emission", _scan(dataset)))


def mesh_cost(stored: VolumeFile) -> Cost:
    """Cost of the iso-surface of a volume as a mesh."""
    return Cost(TaskSize("mesh", _read(stored)))


def export_cost(stored: VolumeFile, name: FormatName) -> Cost:
    """Cost of an export to a format: the volume is read whole, and copied to write it."""
    return Cost(TaskSize(f"export to {name}", _read(stored)))


def truth_cost(stored: VolumeFile, dataset: Mapping[str, Any]) -> Cost:
    """Cost of an export of the truth: the volume, and the scan without its traces, are read whole."""
    return Cost(TaskSize("truth", _with_truth(stored, dataset)))


def summary_cost(stored: VolumeFile, dataset: Mapping[str, Any]) -> Cost:
    """Cost of a summary of a reconstruction, compared with the truth."""
    return Cost(TaskSize("summary", _with_truth(stored, dataset)))


def _with_truth(stored: VolumeFile, dataset: Mapping[str, Any]) -> dict[str, float]:
    # Without traces the file is mostly the truth, which may be compressed to a tenth.
    truth = 0 if dataset["has_traces"] else 10 * int(dataset["bytes"])
    return {**_read(stored), **_scan(dataset), "bytes of the truth": truth}


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


def placed(size: int, workers: Mapping[str, WorkerCapacity]) -> dict[str, Any]:
    """Placement of tasks by their memory, for ``Client.submit``.

    Args:
        size: of each task, bytes.
        workers: by address.

    Returns:
        Resources, and the addresses of able workers unless all are.
    """
    able = {address: capacity for address, capacity in workers.items() if capacity.task_bytes >= size}
    alone = any(size > spare_bytes(capacity) and "recon" in capacity.resources for capacity in able.values())
    placement: dict[str, Any] = {"resources": {**RENDER, **RECONSTRUCTION} if alone else RENDER}
    return placement if len(able) in (0, len(workers)) else {**placement, "workers": list(able)}


def check_memory(field: str, what: str, needed: int, capacities: Sequence[WorkerCapacity]) -> None:
    """Reject a picture that no connected worker can draw; without workers nothing is checked.

    Raises:
        InvalidInput: naming ``field``, with the bytes found and accepted.
    """
    limit = max((capacity.task_bytes for capacity in capacities), default=math.inf)
    if needed > limit:
        given = f"{what}, which takes {needed} bytes of a worker"
        accepted = f"at most {limit:.0f} bytes, or a worker with more memory"
        raise InvalidInput(field, given, accepted)


def _rays(view: RefractionView | FieldView) -> int:
    return view.width * view.height * view.times**2


def _tile(view: RefractionView | FieldView) -> dict[str, float]:
    # At least one row, and one more on each side for post-refraction supersampling.
    rays = min(_rays(view), max(TASK_RAYS, view.width * view.times**2)) + 2 * view.width * view.times**2
    return {"rays of a tile": rays}


def _read(stored: VolumeFile) -> dict[str, float]:
    return {"bytes of the volume": stored.read_bytes, "nodes": math.prod(stored.shape)}


def _scan(dataset: Mapping[str, Any]) -> dict[str, float]:
    """Counts of a scan from its row."""
    emissions = int(dataset["ntx"]) * int(dataset["slices"])
    traces = int(dataset["bytes"]) if dataset["has_traces"] else 0
    emission = traces // max(1, emissions)
    return {
        "pairs": emissions * int(dataset["nrx"]),
        "bytes of an emission": emission,
        "bytes of a read": max(emission, min(traces, BLOCK_BYTES)),
        "bytes of traces": traces,
    }


def _check_seconds(field: str, given: str, seconds: float, width: int, height: int, alternative: str) -> None:
    if seconds > MAX_SECONDS:
        shrink = math.sqrt(MAX_SECONDS / seconds)
        largest = f"{max(1, int(width * shrink))} x {max(1, int(height * shrink))} pixels of these"
        raise InvalidInput(
            field,
            f"{given}: about {seconds:.0f} s of a core",
            f"at most {MAX_SECONDS:g} s, as {largest}{alternative}",
        )
