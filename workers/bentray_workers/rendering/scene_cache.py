"""Cache of scenes: made once per process for each file and filter, within the memory."""

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from bentray_kernels.errors import InvalidInput
from bentray_kernels.refraction import Layers, Scene
from bentray_kernels.refraction.scene import range_at_nodes
from bentray_kernels.splines import Spline

from ..cluster.memory_cache import MemoryCache
from ..cluster.task_cancellation import cancellation_check
from ..files.bounded_reading import LARGEST_BYTES
from ..files.hdf5_reading import Limits, opened
from ..files.volume import Volume
from ..files.volume_formats import import_volume
from .refraction_view import RefractionView, check_even
from .up_axis import standing_axis_of

# Bytes per node, measured for 128³ nodes and rounded up: of a spline, of a scene with it, and at the peak
# while they are made.
SPLINE_BYTES, SCENE_BYTES, BUILDING_BYTES = 9, 15, 48
# Nodes that filters add along each axis, at most.
BORDER = 6

# Peak memory of making one scene: the largest volume has about 560³ nodes.
MAX_BUILDING_BYTES = 8 * 2**30
# Memory of a process for cached scenes.
KEPT_BYTES = 4 * 2**30


class SceneSource(NamedTuple):
    """The file of a scene at a time, and the filter."""

    path: Path
    stamp: int
    size: int
    filter: str
    smoothing: float | None


class FilteredVolume(NamedTuple):
    """A filtered volume; the range is that at the nodes, which smoothing changes."""

    spline: Spline
    spacing_m: tuple[float, float, float]
    range: tuple[float, float]
    smoothing: float


# One of each per process; a spline serves many iso-values.
_SPLINES = MemoryCache(KEPT_BYTES // 2)
_SCENES = MemoryCache(KEPT_BYTES // 2)


def needed_bytes(shape: Sequence[int], each: int) -> int:
    """Bytes of a volume of that shape with so many per node."""
    return math.prod(n + BORDER for n in shape) * each


def check_size(shape: Sequence[int]) -> None:
    """Reject a volume whose scene no worker could make.

    Raises:
        InvalidInput: naming ``volume``.
    """
    needed = needed_bytes(shape, BUILDING_BYTES)
    if needed > MAX_BUILDING_BYTES:
        most = f"volumes that need at most {MAX_BUILDING_BYTES} bytes, {BUILDING_BYTES} a node"
        raise InvalidInput("volume", f"shape {tuple(shape)}, which needs {needed} bytes to render", most)


def scene_at(path: Path, view: RefractionView) -> Scene:
    """The scene of a volume or reconstruction file, cached or new.

    Raises:
        InvalidInput: from the file, for a volume that is too large, and for iso-values out of its range.
    """
    shape = stored_shape(path)
    source, filtered = _filtered(path, shape, view)
    layers = view.filtered_within(*filtered.range).layers()
    # The octree depends on iso-values and surroundings alone, so other refractive indices cost nothing.
    scene: Scene = _SCENES.get(
        (source, layers.isos, layers.surroundings),
        needed_bytes(shape, SCENE_BYTES),
        lambda: build_scene(filtered, layers),
        # The spline is cached already.
        needed_bytes(shape, BUILDING_BYTES - SPLINE_BYTES),
    )
    return replace(scene, layers=layers)


def filtered_at(path: Path, view: RefractionView) -> FilteredVolume:
    """The filtered volume of a volume or reconstruction file, cached or new.

    Raises:
        InvalidInput: from the file, and for a volume that is too large.
    """
    return _filtered(path, stored_shape(path), view)[1]


def default_surface(path: Path) -> tuple[float, float, str]:
    """Iso-value, smoothing and axis that is up of a picture for which none are requested.

    Raises:
        InvalidInput: from the file, and for a volume that is too large or constant.
    """
    filtered = filtered_at(path, RefractionView())
    iso = RefractionView().filtered_within(*filtered.range).iso[0]
    return iso, filtered.smoothing, standing_axis_of(filtered.spline, filtered.spacing_m)


def _filtered(path: Path, shape: tuple[int, ...], view: RefractionView) -> tuple[SceneSource, FilteredVolume]:
    """The filtered volume of a file, cached or new, and its key."""
    check_size(shape)
    status = path.stat()
    source = SceneSource(path, status.st_mtime_ns, status.st_size, view.filter, view.smoothing)
    filtered: FilteredVolume = _SPLINES.get(
        source,
        needed_bytes(shape, SPLINE_BYTES),
        lambda: filter_volume(import_volume(path), view),
        needed_bytes(shape, BUILDING_BYTES),
    )
    return source, filtered


def stored_shape(path: Path) -> tuple[int, ...]:
    """The shape in a volume or reconstruction file, without reading its values."""
    with opened(path, Limits(total_bytes=LARGEST_BYTES)) as reader:
        for array_path in ("values", "speed_mps"):
            stored = reader.checked(array_path, "buif", "(nx, ny, nz) numbers")
            if stored is not None:
                return tuple(int(n) for n in stored.shape)
    raise InvalidInput("values", "nothing", "(nx, ny, nz) numbers")


def filter_volume(volume: Volume, view: RefractionView) -> FilteredVolume:
    """Filter a volume as a view requests, after checking its size."""
    check_even(volume.values.shape, volume.spacing_m)
    check_size(volume.values.shape)
    smoothing = view.smoothing_for(volume.values.dtype)
    spline = Spline.from_volume(volume.values, view.filter, smoothing=smoothing)
    # Without smoothing the filter interpolates the nodes, up to rounding.
    values = range_at_nodes(spline) if smoothing else volume.range()
    return FilteredVolume(spline, volume.spacing_m, values, smoothing)


def build_scene(filtered: FilteredVolume, layers: Layers) -> Scene:
    """The scene, with the centre of the volume at 0."""
    return Scene.build(filtered.spline, layers, filtered.spacing_m, pause=cancellation_check())
