"""The ray tracer on an OpenCL device: the images of ``ray_tracer.trace``, one work-item per pixel."""

import numpy as np

from ...arrays import Flags
from ...errors import InvalidInput
from ...meshes.intersector import WAITING
from ...opencl import Session, Work, computing_on
from ...opencl.device_scene import REALS, DeviceScene, fault_in
from ...opencl.program import Program
from ...refraction.backdrop import Colours
from ...refraction.camera import Camera
from ..tables import accurate_lookup, cube
from . import lookup_scene
from .packed_scene import World
from .ray_tracer import TraceSettings, trace

SOURCES = (
    "refraction/rays",
    "refraction/optics",
    "geometry_field/surface",
    "geometry_field/lookup_scene",
    "geometry_field/ray_tracer",
)

# Pixels of a work-group.
GROUP = 64

# Room for rounding at the far side of boxes, and a number whose reciprocal is finite.
ROUNDING = {"float64": (1.0 + 8.0 * 2.0**-52, 1e300), "float32": (1.0 + 8.0 * 2.0**-23, 1e30)}

# Pixels along the side of the self-test image, and the share of them that may differ by more than one level:
# rays at edges may take either path.
TRIED = 48
ODD = {"float64": 0.01, "float32": 0.05}


# Arrays of the world's surface and of the world, which the kernel calls the same; the last in its precision.
OF_SURFACE = ("triangles", "links", "nodes", "children", "normals", "uv")
OF_WORLD = (
    "shapes",
    "faces",
    "fractions",
    "known",
    "inner_faces",
    "starts",
    "instances",
    "pictures",
    "textures",
    "sky",
)
OF_WORLD_REAL = ("to_local", "looks", "ground", "light")


class OpenCLTracer(DeviceScene):
    """A world on a device; ``ray_tracer.trace`` replaces a device that fails its self-test.

    Args:
        world: ``world_of``; copied to the device, once.
        session, precision: as in ``DeviceScene``.
    """

    instead, work = "tracing.trace", "traces rays"

    def __init__(self, world: World, session: Session, precision: str | None = None) -> None:
        super().__init__(session, precision)
        self.world = world
        with session.lock:
            arrays = {name: getattr(world.surface, name) for name in OF_SURFACE}
            arrays |= {name: getattr(world, name) for name in OF_WORLD}
            arrays |= {name: getattr(world, name).astype(self._real) for name in OF_WORLD_REAL}
            # No device gives a buffer of no bytes.
            self._arguments = {
                name: session.upload(np.ascontiguousarray(array) if array.size else np.zeros(1, array.dtype))
                for name, array in arrays.items()
            }
            self._arguments["count"] = np.int32(len(world.instances))
            self._arguments["sky_rows"], self._arguments["sky_columns"] = map(np.int32, world.sky.shape[:2])

    def trace(self, camera: Camera, settings: TraceSettings) -> Colours:
        """Like ``tracing.ray_tracer.trace``; ``settings.threads`` counts only where the CPU takes over.

        The lookups of (u, v) always run on the CPU.

        Raises:
            DeviceLostError: when the device fails after its self-test.

        Warns:
            OpenCLFallbackWarning: once, where the device fails its self-test and ``ray_tracer.trace`` takes
                over.
        """
        if {settings.way, settings.eye} & set(lookup_scene.UV_WAYS):
            return trace(self.world, camera, settings)
        if not self._passes(lambda: self.fault_of(camera)):
            return trace(self.world, camera, settings)
        with computing_on(self.session):
            return self.follow(camera, settings)

    def fault_of(self, camera: Camera) -> str:
        """Difference from ``ray_tracer.trace`` in a small image, as a message; empty if correct."""
        settings = TraceSettings(TRIED, TRIED)

        def off() -> Flags:
            image = self.follow(camera, settings).astype(int)
            return np.asarray(np.abs(image - trace(self.world, camera, settings)).max(axis=2) > 1)

        return fault_in(off, ODD[self.precision], "pixels")

    def follow(self, camera: Camera, settings: TraceSettings) -> Colours:
        """Like ``trace``, on the device, without self-test.

        Raises:
            InvalidInput: for a lookup of (u, v).
        """
        for name in ("way", "eye"):
            if getattr(settings, name) not in lookup_scene.FACE_WAYS:
                accepted = "on a device one of " + ", ".join(lookup_scene.FACE_WAYS)
                raise InvalidInput(name, getattr(settings, name), accepted)
        image = np.empty((settings.rows, settings.columns, 3), dtype=np.uint8)
        kernel = self.session.kernel(_program(self.precision), "trace")
        with self.session.lock:
            # Setting an argument does not keep its buffer alive: the names do.
            views = self.session.upload(np.stack([camera.origin, camera.direction]).astype(self._real))
            there = self.session.reserve(image.nbytes)
            ways = (lookup_scene.WAYS[settings.eye], lookup_scene.WAYS[settings.way])
            numbers = dict(zip(("eye", "way"), ways, strict=True))
            numbers |= {name: getattr(settings, name) for name in ("depth", "rows", "columns")}
            kernel.set(**self._arguments, camera=views, image=there)
            kernel.set(**{name: np.int32(number) for name, number in numbers.items()})
            pixels = settings.rows * settings.columns
            self.session.launch(kernel, (-(-pixels // GROUP) * GROUP,), (GROUP,))
            self.session.download(image, there)
        return image


def _program(precision: str) -> Program:
    later, never = ROUNDING[precision]
    defines = (
        f"REAL={REALS[precision]}",
        f"LATER=R({later!r})",
        f"NEVER=R({never!r})",
        f"ALMOST_ZERO=R({float(cube.ALMOST_ZERO)!r})",
        f"MARGIN=R({float(cube.MARGIN)!r})",
        f"SLACK=R({float(accurate_lookup.SLACK)!r})",
        f"MIN_DISTANCE=R({lookup_scene.MIN_DISTANCE!r})",
        f"MAX_STEPS={accurate_lookup.STEPS}",
        f"WAITING={WAITING}",
    )
    return Program(SOURCES, defines)


def work_of(world: World, rays: int) -> Work:
    """The rays of a picture of a world, as work for ``opencl.place``."""
    sizes = [array.nbytes for array in (*world.surface, *world) if isinstance(array, np.ndarray)]
    # The colours of the picture.
    return Work("field", rays, sum(sizes) + 3 * rays, max(sizes))
