"""What a picture takes of the workers, from counts alone and before it starts, and whether they have it.

Seconds are of a core of 2023 and typical: rough volumes take several times as long. Bytes are an upper bound;
``tests/workers/rendering/test_picture_cost.py`` holds them against measured peaks.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from bentray_kernels.errors import InvalidInput

from ..cluster.capacities import MIB, Offer
from ..cluster.resources import RECONSTRUCTION, RENDER
from .field_tasks import FACE_BYTES
from .field_view import FieldView
from .refraction_view import RefractionView
from .scene_cache import BUILDING_BYTES, needed_bytes
from .tiles import TASK_RAYS

# Of one picture, s; what takes longer is for a job.
MOST_SECONDS = 60.0

# Of a worker's memory, what a picture may take beside a call of a job. Jobs are planned for 80 % of it less
# what a warm worker holds, which is MARGIN_BYTES more than was measured, and Dask kills at 95 %.
BESIDE_PART = 0.05
MARGIN_BYTES = 96 * MIB

# Python's and Matplotlib's own part of any picture.
FLOOR_BYTES, FLOOR_SECONDS = 48 * MIB, 0.3

# A ray of a strip, and a pixel of a whole picture while strips are joined and packed.
RAY_BYTES, PIXEL_BYTES = 160, 8
RAY_S, SURFACE_S = 6e-7, 1.5e-7
SMOOTH_SCENE_S = 2.5e-7

# A pixel that Matplotlib draws, and packs.
DRAWN_BYTES, DRAWN_S = 56, 2e-7
# Sides of a picture that has no size given, pixels.
USUAL_SIZE = 1200

# A reconstruction has four images at most, float64 each, and is read whole; a volume float32 at most.
IMAGES, REAL = 4, 8
READ_S = 2e-9

# Of a geometry field: a ray of the eye, and each surface at which it may go on (twice where it is exact).
# Measured: 0.3 to 2.4 us a ray at depths to 16, of which most rays need few; glass that fills the picture 22.
FIELD_RAY_S, FIELD_SURFACE_S = 1e-6, 3e-7
SCENE_BYTES = 96 * MIB

# Of traces, bytes: a core examines so many in a second.
TRACE_BYTES_PER_S = 2**25


@dataclass(frozen=True)
class Cost:
    """What one picture takes.

    Attributes:
        seconds: of a core, about, of the whole picture.
        bytes: of a worker, while the task that takes most of them runs.
    """

    seconds: float
    bytes: int


def slice_cost(stored: Stored, size: int | None) -> Cost:
    """A slice of a volume; ``size`` as in ``images.look.Look``."""
    pixels = (size or USUAL_SIZE) ** 2
    seconds = FLOOR_SECONDS + READ_S * stored.read_bytes + DRAWN_S * pixels
    return Cost(seconds, FLOOR_BYTES + stored.read_bytes + DRAWN_BYTES * pixels)


def refraction_cost(stored: Stored, view: RefractionView) -> Cost:
    """A volume as glass.

    Raises:
        InvalidInput: for a picture that takes more than ``MOST_SECONDS``.
    """
    rays, depth = _rays(view), 1 if view.mode == "shaded" else view.depth
    # Filters of a higher degree take more nodes for each value.
    order = int(view.filter[-1]) if view.filter.startswith("bspline") else 3
    ray_s = (RAY_S + SURFACE_S * depth) * (1.0 + 0.5 * max(0, order - 3))
    scene = FLOOR_SECONDS + SMOOTH_SCENE_S * math.prod(stored.shape)
    _check_seconds(
        "width, height, depth",
        f"{view.width} x {view.height} pixels of {view.times**2} rays and depth {depth}",
        rays * ray_s,
        view.width,
        view.height,
        ", or submit a job of kind `refraction` (frames: 1)",
    )
    return Cost(scene + rays * ray_s, refraction_bytes(stored.shape, view))


def refraction_bytes(shape: Sequence[int], view: RefractionView) -> int:
    """Of a worker that draws a part of that picture; the volume is read within what its scene takes."""
    return _strips(view) + needed_bytes(shape, BUILDING_BYTES)


def field_cost(figures: Mapping[str, Any], view: FieldView) -> Cost:
    """A scene with a geometry field, of which ``figures`` tell the sizes.

    Raises:
        InvalidInput: for a picture that takes more than ``MOST_SECONDS``.
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
    # Of the outer table a byte an entry of eight says where entries agree.
    taken = SCENE_BYTES + tables + tables // 8 + surface
    return Cost(FLOOR_SECONDS + rays * ray_s, _strips(view) + taken)


def map_cost(figures: Mapping[str, Any]) -> Cost:
    """A geometry image or a normal map."""
    pixels = int(figures.get("image_pixels", 0)) ** 2
    return Cost(FLOOR_SECONDS + DRAWN_S * pixels, FLOOR_BYTES + 96 * pixels)


def quality_cost(dataset: Mapping[str, Any]) -> Cost:
    """The examination of a scan, of which the row of the dataset tells the counts."""
    pairs = int(dataset["ntx"]) * int(dataset["nrx"]) * int(dataset["slices"])
    traces = int(dataset["bytes"]) if dataset["has_traces"] else 0
    # Traces of one emission of object and water at a time, each a few times over.
    emission = 16 * traces // max(1, int(dataset["ntx"]) * int(dataset["slices"]))
    seconds = 1.0 + traces / TRACE_BYTES_PER_S + 2e-6 * pairs
    return Cost(seconds, 2 * FLOOR_BYTES + DRAWN_BYTES * USUAL_SIZE**2 + emission + 256 * pairs)


def mesh_cost(stored: Stored) -> Cost:
    """The iso-surface of a volume as a mesh."""
    nodes = math.prod(stored.shape)
    return Cost(4.0 + 3e-8 * nodes, 4 * FLOOR_BYTES + stored.read_bytes + 16 * nodes)


def export_cost(stored: Stored) -> Cost:
    """A volume in another format: read whole, and written with a copy of each image at most."""
    return Cost(FLOOR_SECONDS + 4 * READ_S * stored.read_bytes, FLOOR_BYTES + 2 * stored.read_bytes)


@dataclass(frozen=True)
class Stored:
    """The file of a volume, as its row tells of it.

    Attributes:
        shape: (nx, ny[, nz]).
        node_bytes: in memory, of a node of all that is read of it.
    """

    shape: tuple[int, ...]
    node_bytes: int

    @classmethod
    def of(cls, row: Mapping[str, Any]) -> Stored:
        """Of a row of ``volumes`` or ``uploaded_volumes``."""
        nodes = math.prod(row["shape"])
        if "job_id" in row:
            # Read, and made float64.
            return cls(tuple(row["shape"]), (IMAGES + 1) * REAL)
        # The values lie in the file as they are; where they are finite takes a byte each.
        return cls(tuple(row["shape"]), 2 + max(1, min(4, int(row["bytes"]) // nodes)))

    @property
    def read_bytes(self) -> int:
        """Of the whole of it in memory."""
        return math.prod(self.shape) * self.node_bytes


def beside_bytes(offer: Offer) -> float:
    """What a picture may take of a worker while it works for a job; more needs it alone."""
    return MARGIN_BYTES + BESIDE_PART * offer.memory_bytes if offer.memory_bytes else math.inf


def placed(size: int, workers: Mapping[str, Offer]) -> dict[str, Any]:
    """Where tasks that take so many bytes may run, as ``Client.submit`` takes it.

    Args:
        size: bytes.
        workers: those that may do it, by address.

    Returns:
        Resources, and where not every worker can hold it the addresses of those that can.
    """
    able = {address: offer for address, offer in workers.items() if offer.task_bytes >= size}
    alone = any(size > beside_bytes(offer) and "recon" in offer.lanes for offer in able.values())
    where: dict[str, Any] = {"resources": {**RENDER, **RECONSTRUCTION} if alone else RENDER}
    return where if len(able) in (0, len(workers)) else {**where, "workers": list(able)}


def check_memory(field: str, what: str, cost: Cost, offers: Sequence[Offer]) -> None:
    """Refuse what no connected worker can hold; none at all says nothing, for some may come.

    Raises:
        InvalidInput: naming ``field``, with the bytes found and accepted.
    """
    room = max((offer.task_bytes for offer in offers), default=math.inf)
    if cost.bytes > room:
        found = f"{what}, which takes {cost.bytes} bytes of a worker"
        accepted = f"what takes at most {room:.0f} bytes, or a worker with more memory"
        raise InvalidInput(field, found, accepted)


def _rays(view: RefractionView | FieldView) -> int:
    return view.width * view.height * view.times**2


def _strips(view: RefractionView | FieldView) -> int:
    """Of the arrays of a strip, or of the whole picture while its strips are joined."""
    # At least a row, and for post-refraction supersampling one more on each side.
    rays = min(_rays(view), max(TASK_RAYS, view.width * view.times**2)) + 2 * view.width * view.times**2
    return FLOOR_BYTES + max(RAY_BYTES * rays, PIXEL_BYTES * view.width * view.height)


def _check_seconds(field: str, found: str, seconds: float, width: int, height: int, instead: str) -> None:
    if seconds > MOST_SECONDS:
        shrink = math.sqrt(MOST_SECONDS / seconds)
        largest = f"{max(1, int(width * shrink))} x {max(1, int(height * shrink))} pixels of these"
        raise InvalidInput(
            field,
            f"{found}: about {seconds:.0f} s of a core",
            f"at most {MOST_SECONDS:g} s, as {largest}{instead}",
        )
