"""Scenes that are kept: made once a process for each file and filter, as long as there is room."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from bentray_kernels.errors import InvalidInput
from bentray_kernels.refraction import Layers, Scene
from bentray_kernels.refraction.scene import range_at_nodes
from bentray_kernels.splines import Spline

from ..cluster.memory_cache import Kept
from ..cluster.task_cancellation import look_out
from ..files.bounded_reading import LARGEST_BYTES
from ..files.hdf5_reading import Limits, opened
from ..files.volume import Volume
from ..files.volume_formats import import_volume
from .refraction_view import RefractionView, check_even

# Measured of 128 nodes cubed, rounded up, per node: what a spline keeps, what a scene with it keeps, and what
# there is at once while one is made.
SPLINE_BYTES, SCENE_BYTES, BUILDING_BYTES = 9, 15, 48
# Nodes that filters add along each axis, at most.
BORDER = 6

# What one scene may take while it is made: the largest volume has about 560 nodes a side.
MOST_BUILDING_BYTES = 8 * 2**30
# What a process keeps of them.
KEPT_BYTES = 4 * 2**30


class Source(NamedTuple):
    """What a scene is made of: a file as it was at a time, and the filter."""

    path: Path
    stamp: int
    size: int
    filter: str
    smoothing: float


class Filtered(NamedTuple):
    """A volume behind its filter; the range is that at the nodes, which smoothing changes."""

    spline: Spline
    spacing_m: tuple[float, float, float]
    range: tuple[float, float]


# One of each for the process, as ``functools.lru_cache`` would have; a spline serves many iso-values.
_SPLINES = Kept(KEPT_BYTES // 2)
_SCENES = Kept(KEPT_BYTES // 2)


def needed_bytes(shape: Sequence[int], each: int) -> int:
    """Bytes for a volume of that shape, at so many a node."""
    return math.prod(n + BORDER for n in shape) * each


def check_size(shape: Sequence[int]) -> None:
    """Refuse a volume whose scene no worker could make.

    Raises:
        InvalidInput: naming ``volume``.
    """
    needed = needed_bytes(shape, BUILDING_BYTES)
    if needed > MOST_BUILDING_BYTES:
        most = f"volumes that need at most {MOST_BUILDING_BYTES} bytes, {BUILDING_BYTES} a node"
        raise InvalidInput("volume", f"shape {tuple(shape)}, which needs {needed} bytes to render", most)


def scene_at(path: Path, view: RefractionView) -> Scene:
    """The scene of a volume or reconstruction file, from what is kept or made now.

    Raises:
        InvalidInput: from the file, for a volume that is too large, and for iso-values out of its range.
    """
    shape = stored_shape(path)
    check_size(shape)
    status = path.stat()
    source = Source(path, status.st_mtime_ns, status.st_size, view.filter, view.smoothing)
    filtered: Filtered = _SPLINES.get(
        source,
        needed_bytes(shape, SPLINE_BYTES),
        lambda: filtered_of(import_volume(path), view.filter, view.smoothing),
        needed_bytes(shape, BUILDING_BYTES),
    )
    layers = view.filtered_within(*filtered.range).layers()
    # The octree and its box know iso-values and surroundings alone, so that another glass costs nothing.
    scene: Scene = _SCENES.get(
        (source, layers.isos, layers.surroundings),
        needed_bytes(shape, SCENE_BYTES),
        lambda: build(filtered, layers),
        # The spline is kept already.
        needed_bytes(shape, BUILDING_BYTES - SPLINE_BYTES),
    )
    return replace(scene, layers=layers)


def stored_shape(path: Path) -> tuple[int, ...]:
    """The shape in a volume or reconstruction file of ours, without reading its values."""
    with opened(path, Limits(total_bytes=LARGEST_BYTES)) as reader:
        for place in ("values", "speed_mps"):
            found = reader.checked(place, "buif", "(nx, ny, nz) numbers")
            if found is not None:
                return tuple(int(n) for n in found.shape)
    raise InvalidInput("values", "nothing", "(nx, ny, nz) numbers")


def filtered_of(volume: Volume, filter_name: str, smoothing: float) -> Filtered:
    """A volume behind a filter, once it is known to fit."""
    check_even(volume.values.shape, volume.spacing_m)
    check_size(volume.values.shape)
    spline = Spline.of(volume.values, filter_name, smoothing=smoothing)
    # Where nothing is smoothed the filter passes through the nodes, but for rounding.
    return Filtered(spline, volume.spacing_m, range_at_nodes(spline) if smoothing else volume.range())


def build(filtered: Filtered, layers: Layers) -> Scene:
    """The scene, with the middle of the volume at 0."""
    return Scene.build(filtered.spline, layers, filtered.spacing_m, pause=look_out())
