"""The device that draws a picture: scenes kept in its memory, and its name for the result."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

from bentray_kernels.geometry_field.tracing.packed_scene import World
from bentray_kernels.geometry_field.tracing.ray_tracer_opencl import OpenCLTracer
from bentray_kernels.geometry_field.tracing.ray_tracer_opencl import work_of as work_of_world
from bentray_kernels.opencl import Session, computed, computing_on, select_engine
from bentray_kernels.refraction import Scene
from bentray_kernels.refraction.caster_opencl import OpenCLCaster
from bentray_kernels.refraction.caster_opencl import work_of as work_of_scene

from ..cluster.memory_cache import MemoryCache
from ..images.png import Colours

# What draws where no device does.
PROCESSOR = "processor"

# Memory of a process for the scenes in the memory of its device, which cannot be copied back.
KEPT_BYTES = 2**30

_CASTERS = MemoryCache(KEPT_BYTES)
_TRACERS = MemoryCache(KEPT_BYTES)


class Drawn(NamedTuple):
    """Rows of a picture.

    Attributes:
        image: (rows, width, 3) 8-bit RGB.
        device: that drew them.
    """

    image: Colours
    device: str


def drawn_by(draw: Callable[[], Drawn]) -> Drawn:
    """Result of ``draw``; drawn once more on the processor if the device is lost."""
    rows, lost = computed(draw)
    return rows._replace(device=f"{PROCESSOR}: {lost}") if lost else rows


def name_of(session: Session | None, fault: str = "") -> str:
    """The name of what draws; with a fault the processor took over."""
    if session is None:
        return PROCESSOR
    name = f"{session.device.label}, driver {session.device.driver}"
    return f"{PROCESSOR}: {name} failed its test of this scene: {fault}" if fault else name


def caster_for(scene: Scene, rays: int, device: str) -> OpenCLCaster | None:
    """The caster of a refractive rendering on the device; None: compiled code casts the rays.

    Args:
        scene: to render.
        rays: that are cast together.
        device: the request, see ``opencl.place``.

    Raises:
        InvalidInput, DeviceLostError: as ``opencl.place``.
    """
    work = work_of_scene(scene, rays)
    session = select_engine(work, device)
    if session is None:
        return None
    with computing_on(session):
        # The cached caster holds these two, so their ids stay theirs.
        caster: OpenCLCaster = _CASTERS.get(
            (id(scene.field.coefficients), id(scene.octree), session),
            work.memory_bytes,
            lambda: OpenCLCaster(scene, session, "float32"),
        )
    # Only the refractive indices may differ.
    return caster


def tracer_for(world: World, rays: int, device: str) -> OpenCLTracer | None:
    """The tracer of a geometry field on the device; None: compiled code traces the rays.

    Args, Raises:
        As ``caster_for``.
    """
    work = work_of_world(world, rays)
    session = select_engine(work, device)
    if session is None:
        return None
    with computing_on(session):
        tracer: OpenCLTracer = _TRACERS.get(
            (id(world), session), work.memory_bytes, lambda: OpenCLTracer(world, session)
        )
    return tracer


def devices_of(tiles: Sequence[Drawn]) -> str:
    """The devices that drew the parts of a picture."""
    return "; ".join(sorted({tile.device for tile in tiles}))
