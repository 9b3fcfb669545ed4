"""Problems that OpenCL and compiled code solve alike: one for each engine."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from bentray_kernels import eikonal
from bentray_kernels.arrays import Floats
from bentray_kernels.geometry_field.tracing.packed_scene import world_of
from bentray_kernels.geometry_field.tracing.ray_tracer import TraceSettings, trace
from bentray_kernels.geometry_field.tracing.ray_tracer_opencl import on_the_device as tracer_on_the_device
from bentray_kernels.phantoms import TABLE6_SIDE_M, table6
from bentray_kernels.refraction import RenderSettings, render
from bentray_kernels.refraction.caster_opencl import on_the_device as caster_on_the_device
from bentray_kernels.splines import Spline
from bentray_kernels.splines.sampling_opencl import OpenCLSpline
from bentray_kernels.splines.sampling_opencl import on_the_device as spline_on_the_device
from bentray_kernels.wave.emissions import Emissions, misfit_gradients, simulate_emissions
from bentray_kernels.wave.emissions import Engine as WaveEngine
from bentray_kernels.wave.medium import Medium

from ..geometry_field._geometry_scenes import SCENES
from ..refraction._refracting_ball import board, camera, scene, signed_distance

WATER_MPS = 1500.0


@dataclass(frozen=True)
class Engine:
    """One problem, solved here and on the device.

    Attributes:
        name: what is computed, and its size.
        here: solves it with compiled code in one thread.
        there: solves it on the device; None where the device computes this engine wrong.
        work: of one solve, in ``unit``.
        unit: what is counted, for example node updates.
        least_bytes: that one solve reads and writes at the least, each array once a pass.
        error: largest difference of the two results, in ``error_unit``.
        bound: of that difference.
    """

    name: str
    here: Callable[[], Floats]
    there: Callable[[], Floats] | None
    work: float
    unit: str
    least_bytes: float
    error: Callable[[Floats, Floats], float]
    error_unit: str
    bound: float


def engines(quick: bool) -> Iterator[Engine]:
    """The engines, each built when its turn comes."""
    yield projection(64 if quick else 256, 1)
    yield projection(64 if quick else 256, 4 if quick else 64)
    yield traces(60 if quick else 212, 100 if quick else 800, 2 if quick else 8)
    yield gradients(60 if quick else 212, 100 if quick else 800, 2 if quick else 8)
    yield spline(10_000 if quick else 1_000_000)
    yield glass(64 if quick else 512)
    yield field(64 if quick else 512)


def projection(nodes: int, sources: int) -> Engine:
    """Travel times by the fast iterative method, of one emitter or of many together."""
    speed, spacing = table6(WATER_MPS).speed(nodes, TABLE6_SIDE_M), TABLE6_SIDE_M / (nodes - 1)
    angle = 2.0 * np.pi * np.arange(sources) / sources
    places = TABLE6_SIDE_M * (0.5 + 0.45 * np.column_stack((np.cos(angle), np.sin(angle))))
    speeds = np.broadcast_to(speed, (sources, *speed.shape))
    return Engine(
        f"fast iterative method, {sources} of {nodes}²",
        lambda: eikonal.solve_many(speeds, spacing, places, "fim"),
        lambda: eikonal.solve_many(speeds, spacing, places, "fim-opencl"),
        float(sources * nodes**2),
        "nodes",
        16.0 * sources * nodes**2,
        relative,
        "of the largest",
        1e-9,
    )


def traces(nodes: int, steps: int, emitters: int) -> Engine:
    """Traces of emitters on a ring, float32."""
    medium, emissions = wave_scan(nodes, steps, emitters)
    work = float(emitters * steps * medium.keep.size)

    def simulated(engine: WaveEngine) -> Floats:
        return np.stack(list(simulate_emissions(medium, emissions, engine=engine)))

    return Engine(
        f"waves forwards, {emitters} of {nodes}², {steps} steps",
        lambda: simulated("compiled"),
        lambda: simulated("opencl"),
        work,
        "node updates",
        STEP_BYTES * work,
        relative,
        "of the largest",
        1e-5,
    )


def gradients(nodes: int, steps: int, emitters: int) -> Engine:
    """Gradients of emitters on a ring by the speed, float32, every fourth field stored."""
    medium, emissions = wave_scan(nodes, steps, emitters)
    updates, stored = float(emitters * steps * medium.keep.size), emitters * steps / 4 * nodes**2

    def energy(k: int, samples: Floats) -> tuple[float, Floats]:
        return 0.5 * float((samples**2).sum()), samples

    def summed(engine: WaveEngine) -> Floats:
        parts = misfit_gradients(medium, emissions, energy, 4, engine=engine)
        return np.stack([part.gradient for part in parts])

    return Engine(
        f"waves and adjoint, {emitters} of {nodes}², {steps} steps",
        lambda: summed("compiled"),
        lambda: summed("opencl"),
        2.0 * updates,
        "node updates",
        # A stored field is written and read, the adjoint read, image and illumination read and written.
        2.0 * STEP_BYTES * updates + 7.0 * 4.0 * stored,
        relative,
        "of the largest",
        1e-4,
    )


# Of a node in a step in float32: two fields are read and one is written; the three factors of the medium are
# the same for all emitters and remain in a cache.
STEP_BYTES = 12.0


def wave_scan(nodes: int, steps: int, emitters: int) -> tuple[Medium, Emissions]:
    """A random medium, and emitters on a ring of 64 receivers."""
    spacing, step = 5e-4, 1e-7
    speed = np.random.default_rng(0).uniform(1400.0, 1600.0, (nodes, nodes))
    medium = Medium.of(speed, spacing, step, dtype=np.float32)
    time = step * np.arange(steps)
    pulse = np.exp(-(((time - 6e-6) * 3e5) ** 2)) * np.sin(2e6 * np.pi * 0.3 * (time - 6e-6))
    angle = 2.0 * np.pi * np.arange(64) / 64
    ring = spacing * (0.5 * (nodes - 1) + 0.45 * nodes * np.column_stack((np.cos(angle), np.sin(angle))))
    senders = ring[np.linspace(0, 64, emitters, endpoint=False).astype(int)]
    return medium, Emissions(senders, ring, [np.arange(64)] * emitters, pulse)


def spline(points: int) -> Engine:
    """Values and gradients of the cubic B-spline of a ball at scattered points."""
    volume = Spline(signed_distance())
    places = np.random.default_rng(1).uniform(1.0, min(volume.shape) - 2.0, (points, 3))
    there = spline_on_the_device(volume)
    return Engine(
        f"cubic B-spline, {points:,} values and gradients",
        lambda: both(volume.value_and_gradient(places)),
        (lambda: both(there.value_and_gradient(places))) if isinstance(there, OpenCLSpline) else None,
        float(points),
        "points",
        7.0 * 8.0 * points,
        relative,
        "of the largest",
        1e-12,
    )


def glass(pixels: int) -> Engine:
    """A picture of a refracting ball, float32 rays."""
    made = scene(Spline(signed_distance()), 0.0)
    caster = caster_on_the_device(made, "float32")
    settings = RenderSettings(pixels, pixels)
    return Engine(
        f"refractive rendering, {pixels}²",
        lambda: render(made, camera(), board(), settings, None).image.astype(float),
        (lambda: render(made, camera(), board(), settings, caster).image.astype(float)) if caster else None,
        float(pixels**2),
        "pixels",
        3.0 * pixels**2,
        odd_pixels,
        "of the pixels",
        5e-3,
    )


def field(pixels: int) -> Engine:
    """A picture of two bodies with geometry fields and a mirror."""
    arranged, eye = SCENES["two instances in a mirror"]()
    world = world_of(arranged)
    settings = TraceSettings(pixels, pixels)
    tracer = tracer_on_the_device(world)
    good = tracer is not None and tracer.fault_of(eye) == ""
    return Engine(
        f"geometry field, {pixels}²",
        lambda: trace(world, eye, settings).astype(float),
        (lambda: tracer.follow(eye, settings).astype(float)) if tracer is not None and good else None,
        float(pixels**2),
        "pixels",
        3.0 * pixels**2,
        odd_pixels,
        "of the pixels",
        1e-3,
    )


def both(read: tuple[Floats, Floats]) -> Floats:
    """Values and gradients in one array."""
    return np.column_stack(read)


def relative(found: Floats, expected: Floats) -> float:
    """Largest difference over the largest value."""
    return float(np.abs(found - expected).max() / np.abs(expected).max())


def odd_pixels(found: Floats, expected: Floats) -> float:
    """Fraction of pixels that differ by more than one of 255."""
    return float((np.abs(found - expected).max(axis=2) > 1.0).mean())
