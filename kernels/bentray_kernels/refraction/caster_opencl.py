"""The ray caster on an OpenCL device: the same rays as ``caster.cast``, one work-item per ray."""

from typing import Any, NamedTuple

import numpy as np

from ..arrays import Flags, Floats
from ..errors import InvalidInput
from ..isosurface import crossing
from ..isosurface.crossing import Search
from ..isosurface.roots import STEPS
from ..opencl import Session, Work, computing_on
from ..opencl.device_scene import REALS, DeviceScene, fault_in
from ..opencl.program import Program
from ..splines.sampling import Stencil
from .camera import perspective
from .caster import RefractiveMedium, Traced, allocate_results, cast
from .scene import Scene

# In order of dependence.
SOURCES = tuple(f"refraction/{job}" for job in ("rays", "field", "roots", "crossing", "optics", "caster"))

# Rays of a work-group.
GROUP = 64

# Names of the root finders in the kernel.
WITHIN_CELLS = {
    crossing.CERTAIN: "CERTAIN",
    crossing.CERTAIN_BRENT: "CERTAIN_BRENT",
    crossing.BRENT: "BRENT",
    crossing.ANALYTIC: "ANALYTIC",
}

# Accuracy of a crossing and the shortest piece of a ray that is still halved, nodes. A thousand nodes from
# the camera neighbouring numbers of float32 lie 1e-4 nodes apart.
FINENESS = {"float64": (crossing.TOLERANCE, crossing.SHORTEST), "float32": (1e-4, 1e-3)}

# Rays of the self-test, and their most interfaces: rounding differences grow at each of them.
TRIED, TRIED_DEPTH = 256, 4

# Tolerance of directions in the self-test, and the share of rays that may exceed it: grazing rays, and rays
# close to an edge, may take either path.
TOLERANCES = {"float64": (1e-6, 0.02), "float32": (1e-2, 0.05)}


# Arguments of the kernel that are ``Traced``.
RESULTS = ("points", "directions", "fates", "crossings", "weights")


class Rays(NamedTuple):
    """Arguments of ``caster.cast``."""

    medium: RefractiveMedium
    search: Search
    camera: tuple[Floats, Floats]
    places: Floats
    depth: int
    traced: Traced


class OpenCLCaster(DeviceScene):
    """A scene on a device; ``caster.cast`` replaces root finders that fail their self-test.

    Args:
        scene: its volume and octree are copied to the device, once.
        session: the device.
        precision: of all numbers there; "float32" finds crossings to 1e-4 nodes instead of 1e-9.
    """

    instead, work = "caster.cast", "casts rays"

    def __init__(self, scene: Scene, session: Session, precision: str | None = None) -> None:
        super().__init__(session, precision)
        self.scene = scene
        # Sums are in the type of the coefficients, as on the CPU.
        self._sum: Any = min(self._real, scene.field.coefficients.dtype, key=lambda kind: kind.itemsize)
        with session.lock:
            counts = map(np.int32, scene.field.coefficients.shape)
            self._arguments: dict[str, Any] = {
                "coefficients": session.upload(scene.field.coefficients.astype(self._sum, copy=False)),
                "tables": session.upload(scene.field.stencil.weights.astype(self._sum)),
                "shift": self._real.type(scene.field.stencil.shift),
                **dict(zip(("counts_x", "counts_y", "counts_z"), counts, strict=True)),
                "masks": session.upload(scene.octree.masks),
                "bend": session.upload(scene.octree.bend),
                "shapes": session.upload(scene.octree.levels.astype(np.int64)),
            }

    def cast(
        self,
        medium: RefractiveMedium,
        search: Search,
        camera: tuple[Floats, Floats],
        pixels: Floats,
        depth: int,
        traced: Traced,
    ) -> None:
        """See ``caster.cast``.

        Raises:
            InvalidInput: for a medium of another scene.
            DeviceLostError: when the device fails after its self-test.

        Warns:
            OpenCLFallbackWarning: once for each root finder for which the device fails its self-test and
                ``caster.cast`` traces the rays.
        """
        if medium.octree is not self.scene.octree:
            raise InvalidInput("medium", "that of another scene", "a medium of the scene on the device")
        rays = Rays(medium, search, camera, pixels, depth, traced)
        if self._passes(lambda: self.fault_of(medium, search), _way(search)):
            with computing_on(self.session):
                self.follow(rays)
        else:
            cast(*rays)

    def fault_of(self, medium: RefractiveMedium, search: Search) -> str:
        """Difference from ``caster.cast`` for rays at the object, as a message; empty if correct."""
        far, allowed = TOLERANCES[self.precision]

        def off() -> Flags:
            traced, expected = (allocate_results(TRIED) for _ in range(2))
            rays = Rays(medium, search, *_towards_the_object(self.scene), TRIED_DEPTH, traced)
            self.follow(rays)
            cast(*rays._replace(traced=expected))
            same = (traced.fate == expected.fate) & (traced.crossed == expected.crossed)
            same &= np.abs(traced.direction - expected.direction).max(axis=1) <= far
            return np.asarray(~same)

        return fault_in(off, allowed, "rays")

    def follow(self, rays: Rays) -> None:
        """Like ``cast``, on the device, without self-test."""
        # Place, point, direction, weight and the two whole numbers of a ray.
        at_once = max(1, self.session.doubles_at_once() // 10)
        program = _program(self.precision, self._sum.name, self.scene.field.stencil, _way(rays.search))
        kernel = self.session.kernel(program, "follow")
        for start in range(0, len(rays.places), at_once):
            part = slice(start, start + at_once)
            with self.session.lock:
                self._launch(kernel, rays._replace(places=rays.places[part], traced=rays.traced.part(part)))

    def _launch(self, kernel: Any, rays: Rays) -> None:
        medium, search, camera, pixels, depth, traced = rays
        real, session = self._real.type, self.session
        frame = np.array([medium.origin, medium.density, medium.low, medium.high])
        # Setting an argument does not keep its buffer alive: the names do.
        levels, indices, frames, views, at = (
            session.upload(np.ascontiguousarray(array, real))
            for array in (medium.levels, medium.indices, frame, np.stack(camera), pixels)
        )
        filled: list[Any] = [*traced]
        there = [self._room_for(array) for array in filled]
        kernel.set(
            **self._arguments,
            top=np.int32(search.top),
            levels=levels,
            indices=indices,
            layers=np.int32(len(medium.indices)),
            around=np.int32(medium.around),
            frame=frames,
            open=np.int32(medium.open),
            step=real(search.step),
            camera=views,
            depth=np.int32(depth),
            count=np.uint32(len(pixels)),
            places=at,
            **dict(zip(RESULTS, there, strict=True)),
        )
        session.launch(kernel, (-(-len(pixels) // GROUP) * GROUP,), (GROUP,))
        for array, buffer in zip(filled, there, strict=True):
            if array.size:
                self._download(array, buffer)

    def _room_for(self, array: Any) -> Any:
        # No device gives a buffer of no bytes.
        return self.session.reserve(max(array.size, 1) * self._kind_of(array).itemsize)

    def _download(self, array: Any, buffer: Any) -> None:
        kind = self._kind_of(array)
        here = array if array.dtype == kind and array.flags.c_contiguous else np.empty(array.shape, kind)
        self.session.download(here, buffer)
        if here is not array:
            array[...] = here

    def _kind_of(self, array: Any) -> Any:
        return self._real if array.dtype.kind == "f" else array.dtype


def _program(precision: str, summed: str, stencil: Stencil, way: str) -> Program:
    tolerance, shortest = FINENESS[precision]
    defines = (
        f"REAL={REALS[precision]}",
        f"SUM={REALS[summed]}",
        f"TAPS={len(stencil.places)}",
        f"POWERS={int(np.flatnonzero(stencil.weights.any(axis=(1, 2)))[-1]) + 1}",
        f"WIDTH={stencil.weights.shape[-1]}",
        f"HOW={way}",
        f"TOLERANCE={tolerance}",
        f"SHORTEST={shortest}",
        f"MAX_HALVINGS={crossing.MAX_HALVINGS}",
        f"UNPROVED={crossing.UNPROVED}",
        f"DEEPEST={STEPS}",
    )
    return Program(SOURCES, defines)


def work_of(scene: Scene, rays: int) -> Work:
    """The rays of a picture of a scene, as work for ``opencl.place``; rays are cast in parts that fit."""
    arrays = (scene.field.coefficients, scene.octree.masks, scene.octree.bend)
    sizes = [array.nbytes for array in arrays]
    # Rays take a quarter of the memory, see ``Session.doubles_at_once``.
    return Work("refraction", rays, 4 * sum(sizes) // 3, max(sizes))


def _way(search: Search) -> str:
    return "STEPS" if search.step > 0.0 else WITHIN_CELLS[search.roots]


def _towards_the_object(scene: Scene) -> tuple[tuple[Floats, Floats], Floats]:
    """An oblique camera with the whole box of the object in view, and positions in its image."""
    low, high = scene.origin + scene.box * scene.spacing
    middle, size = 0.5 * (low + high), float(np.linalg.norm(high - low))
    camera = perspective(middle - 1.5 * size * np.array([0.48, 0.6, 0.64]), middle, (0.0, 0.0, 1.0), 40.0)
    pixels = np.random.default_rng(0).uniform(-0.5, 0.5, (TRIED, 2))
    return (camera.origin, camera.direction), pixels
