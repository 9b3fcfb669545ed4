"""The example problems of each engine, for the table of a device and for its benchmark."""

import os
from collections.abc import Iterator
from functools import cache

import numpy as np
from scipy.ndimage import map_coordinates

from .. import eikonal
from ..acquisition import Dataset
from ..acquisition.simulation.ring_scan import Ring
from ..arrays import Floats
from ..geometry_field.tables.inner_field import build_inner_rows, inner_field, spread_points
from ..geometry_field.tables.outer_field import build_rows, outer_field
from ..geometry_field.tracing.packed_scene import World, world_of
from ..geometry_field.tracing.ray_tracer import TraceSettings, trace
from ..geometry_field.tracing.ray_tracer_opencl import OpenCLTracer
from ..geometry_field.tracing.scene import Ground, Instance, Material, Shape, placed
from ..geometry_field.tracing.scene import Scene as FieldScene
from ..meshes.example_surfaces import sphere
from ..meshes.mesh import Chart
from ..meshes.surface import surface_of
from ..phantoms import TABLE6_SIDE_M, table6
from ..refraction import (
    Layers,
    RenderSettings,
    Scene,
    backdrop_of,
    checkerboard,
    orthographic,
    perspective,
    render,
)
from ..refraction.caster_opencl import OpenCLCaster
from ..splines import Spline
from ..tomography import Problem, Settings
from ..tomography.grid_schedule import initial_slowness
from ..tomography.reflection.delay_and_sum import PAIR_ANGLE_DEG, Pixels, Signals, Sums, sum_echoes
from ..tomography.reflection.delay_and_sum_opencl import sum_echoes_opencl
from ..tomography.reflection.element_times import solve_times
from ..tomography.sart.device_slices import TRIAL_EMITTERS
from ..tomography.sart.sart_slices import SliceCall, advance_slices
from ..tomography.sart.sart_step import begin
from ..wave.emissions import Emissions, misfit_gradients, simulate_emissions
from ..wave.emissions import Engine as WaveEngine
from ..wave.medium import Medium
from .engine import ODD_PIXELS, RELATIVE, RMS, Engine

WATER_MPS = 1500.0

# Rows of the table, see ``engines``.
ENGINES_COMPARED = 9

# Of a node in a step in float32: two fields are read and one is written; the three factors of the medium are
# the same for all emitters and remain in a cache.
STEP_BYTES = 12.0

# Of a scan for SART.
SART_RECEIVERS = 128

# Threads of compiled code that draw a picture, as many as the service uses.
DRAWING_THREADS = min(4, len(os.sched_getaffinity(0)))

# Of the refracting ball, nodes: sides of its volume, radius, places of camera and backdrop on the z axis.
BALL_NODES, BALL_RADIUS, CAMERA_Z, BACKDROP_Z = 64, 22.0, -60.0, 60.0

# Samples along an edge of the cube for rays from outside and from the surface, and divisions for the points
# of the latter.
OUTER, INNER, DIVISIONS = 12, 8, 8
SKY = np.linspace(0.2, 1.0, 8 * 16 * 3).reshape(8, 16, 3)


def engines(quick: bool) -> Iterator[Engine]:
    """The rows of the table, each built when its turn comes."""
    yield projection(64 if quick else 256, 1)
    yield projection(64 if quick else 256, 4 if quick else 64)
    yield traces(60 if quick else 212, 100 if quick else 800, 2 if quick else 8)
    yield gradients(60 if quick else 212, 100 if quick else 800, 2 if quick else 8)
    yield traces_in_space(20 if quick else 210, 32)
    yield sart(64 if quick else 128, 2 if quick else 8)
    yield echoes(*((64, 16, 2) if quick else (256, 256, 16)))
    yield refraction(64 if quick else 512)
    yield field(64 if quick else 512)


def benchmark_problems(engine: str) -> Iterator[Engine]:
    """A small and a large problem of an engine of ``opencl.device_benchmark.ENGINES``."""
    makers = {
        "eikonal": lambda size: projection((32, 256)[size], 1),
        "wave": lambda size: gradients(*((60, 60, 2), (212, 200, 8))[size]),
        "sart": lambda size: sart(*((64, 1), (128, 8))[size]),
        "reflection": lambda size: echoes(*((64, 16, 2), (256, 128, 4))[size]),
        "refraction": lambda size: refraction((32, 256)[size]),
        "field": lambda size: field((32, 256)[size]),
    }
    for size in range(2):
        yield makers[engine](size)


def projection(nodes: int, sources: int) -> Engine:
    """Travel times by the fast iterative method, of one emitter or of many together."""
    speed, spacing = table6(WATER_MPS).speed(nodes, TABLE6_SIDE_M), TABLE6_SIDE_M / (nodes - 1)
    angle = 2.0 * np.pi * np.arange(sources) / sources
    places = TABLE6_SIDE_M * (0.5 + 0.45 * np.column_stack((np.cos(angle), np.sin(angle))))
    speeds = np.broadcast_to(speed, (sources, *speed.shape))
    return Engine(
        "eikonal",
        f"fast iterative method, {sources} of {nodes}²",
        lambda: eikonal.solve_many(speeds, spacing, places, "fim"),
        lambda: eikonal.solve_many(speeds, spacing, places, "fim-opencl"),
        float(sources * nodes**2),
        "nodes",
        16.0 * sources * nodes**2,
        RELATIVE,
        1e-9,
    )


def traces(nodes: int, steps: int, emitters: int) -> Engine:
    """Traces of emitters on a ring, float32."""
    name = f"waves forwards, {emitters} of {nodes}², {steps} steps"
    return _simulated(name, *wave_scan(nodes, steps, emitters), STEP_BYTES)


def traces_in_space(nodes: int, steps: int) -> Engine:
    """Traces of one emitter in 3-D, float32; 256³ nodes with the absorbing edges of 210³."""
    spacing, step = 5e-4, 1e-7
    speed = np.random.default_rng(0).uniform(1400.0, 1600.0, (nodes,) * 3)
    medium = Medium.from_speed(speed, spacing, step, dtype=np.float32)
    middle = 0.5 * spacing * (nodes - 1)
    points = np.array([[middle, middle, middle], [middle, middle, middle + 4.0 * spacing]])
    pulse = np.exp(-(((np.arange(steps) - 0.5 * steps) * 6.0 / steps) ** 2))
    emissions = Emissions(points[:1], points, [np.arange(2)], pulse)
    name = f"3-D waves forwards, {medium.keep.shape[0]}³ with edges, {steps} steps"
    # With one emitter the factors of the medium are read from memory, too.
    return _simulated(name, medium, emissions, 2.0 * STEP_BYTES)


def _simulated(name: str, medium: Medium, emissions: Emissions, step_bytes: float) -> Engine:
    work = float(len(emissions.emitters) * emissions.wavelet.size * medium.keep.size)

    def simulated(engine: WaveEngine) -> Floats:
        return np.stack(list(simulate_emissions(medium, emissions, engine=engine)))

    return Engine(
        "traces",
        name,
        lambda: simulated("compiled"),
        lambda: simulated("opencl"),
        work,
        "node updates",
        step_bytes * work,
        RELATIVE,
        1e-5,
    )


def gradients(nodes: int, steps: int, emitters: int) -> Engine:
    """Gradients of emitters on a ring by the speed, float32, every fourth field stored."""
    medium, emissions = wave_scan(nodes, steps, emitters)
    updates, stored = float(emitters * steps * medium.keep.size), emitters * steps / 4 * nodes**2

    def energy(k: int, samples: Floats) -> tuple[float, Floats]:
        return 0.5 * float((samples**2).sum()), samples

    def summed(engine: WaveEngine) -> Floats:
        shots = misfit_gradients(medium, emissions, energy, 4, engine=engine)
        return np.stack([shot.gradient for shot in shots])

    return Engine(
        "wave",
        f"waves and adjoint, {emitters} of {nodes}², {steps} steps",
        lambda: summed("compiled"),
        lambda: summed("opencl"),
        2.0 * updates,
        "node updates",
        # A stored field is written and read, the adjoint read, image and illumination read and written.
        2.0 * STEP_BYTES * updates + 7.0 * 4.0 * stored,
        RELATIVE,
        1e-4,
    )


def wave_scan(nodes: int, steps: int, emitters: int) -> tuple[Medium, Emissions]:
    """A random medium, and emitters on a ring of 64 receivers."""
    spacing, step = 5e-4, 1e-7
    speed = np.random.default_rng(0).uniform(1400.0, 1600.0, (nodes, nodes))
    medium = Medium.from_speed(speed, spacing, step, dtype=np.float32)
    time = step * np.arange(steps)
    pulse = np.exp(-(((time - 6e-6) * 3e5) ** 2)) * np.sin(2e6 * np.pi * 0.3 * (time - 6e-6))
    angle = 2.0 * np.pi * np.arange(64) / 64
    ring = spacing * (0.5 * (nodes - 1) + 0.45 * nodes * np.column_stack((np.cos(angle), np.sin(angle))))
    senders = ring[np.linspace(0, 64, emitters, endpoint=False).astype(int)]
    return medium, Emissions(senders, ring, [np.arange(64)] * emitters, pulse)


def sart(nodes: int, slices: int) -> Engine:
    """Slices of a ring scan of a phantom, updated by ``TRIAL_EMITTERS`` emitters each."""
    calls, settings = sart_scan(nodes, slices)

    def speeds(device: str) -> Floats:
        states = advance_slices(calls, settings.changed(device=device))
        return np.stack([1.0 / state.slowness for state in states])

    return Engine(
        "sart",
        f"Eikonal-SART, {slices} of {nodes}², {TRIAL_EMITTERS} emitters each",
        lambda: speeds("cpu"),
        lambda: speeds("opencl"),
        float(TRIAL_EMITTERS * slices * nodes**2),
        "nodes",
        None,
        RMS,
        0.05,
    )


def sart_scan(nodes: int, slices: int) -> tuple[list[SliceCall], Settings]:
    """The begin of a reconstruction of slices that are all the same."""
    ring, sending = Ring(SART_RECEIVERS, 0.45 * TABLE6_SIDE_M), np.arange(TRIAL_EMITTERS)
    positions = ring.positions()
    speed, spacing = table6(WATER_MPS).speed(nodes, TABLE6_SIDE_M), TABLE6_SIDE_M / (nodes - 1)
    senders = np.linspace(0, ring.elements, TRIAL_EMITTERS, endpoint=False).astype(int)
    positions_n = positions / spacing + 0.5 * (nodes - 1)
    times = eikonal.solve_many(
        np.broadcast_to(speed, (TRIAL_EMITTERS, *speed.shape)), spacing, spacing * positions_n[senders], "fsm"
    )
    measured = np.stack([map_coordinates(time, positions_n.T, order=1) for time in times])
    offset = positions[senders, None] - positions
    delta = measured - np.sqrt((offset**2).sum(axis=2)) / WATER_MPS
    delta[sending, senders] = np.nan
    scan = Dataset(positions, senders, np.arange(ring.elements), WATER_MPS, delta_tof_s=delta)
    settings = Settings.from_values(method="sart", nodes=nodes, side_m=TABLE6_SIDE_M, iterations=2)
    problem = Problem.from_dataset(scan, settings)
    state = begin(initial_slowness(problem, None))
    return [SliceCall(problem, state, TRIAL_EMITTERS, k) for k in range(slices)], settings


def echoes(pixels: int, elements: int, emissions: int) -> Engine:
    """Delay and sum of some emissions of a ring in water, all elements of which receive; signals of noise."""
    spacing, nodes, middle = 2e-3, 64, 0.063
    turn = 2.0 * np.pi * np.arange(elements) / elements
    ring = 0.05 * np.column_stack((np.cos(turn), np.sin(turn)))
    times = solve_times(np.full((nodes, nodes), WATER_MPS), spacing, ring + middle)
    step = 0.096 / pixels
    line = step * (np.arange(pixels) - 0.5 * (pixels - 1))
    inside = np.hypot(line[:, None], line[None, :]) < 0.048
    grid = Pixels(np.full(2, (middle + line[0]) / spacing), step / spacing, inside)
    samples = np.random.default_rng(2).standard_normal((emissions, elements, 2, 2000)).astype(np.float32)
    samples[..., [0, -1]] = 0.0
    signals = Signals(samples, np.ones((emissions, elements), bool), 0.0, 1e7)
    receivers = np.arange(elements)
    senders = receivers[np.linspace(0, elements, emissions, endpoint=False).astype(int)]
    scan = signals, times, spacing, senders, receivers, grid, PAIR_ANGLE_DEG

    def image(sums: Sums) -> Floats:
        return np.stack((sums.echo.real, sums.echo.imag)).astype(float)

    return Engine(
        "reflection",
        f"delay and sum, {emissions} x {elements} pairs x {pixels}²",
        lambda: image(sum_echoes(*scan)),
        lambda: image(sum_echoes_opencl(*scan)),
        float(emissions * elements * inside.sum()),
        "pairs",
        None,
        RELATIVE,
        1e-3,
    )


def refraction(pixels: int) -> Engine:
    """A picture of a refracting ball, float32 rays."""
    made = glass_ball()
    caster = OpenCLCaster.on_the_device(made, "float32")
    settings = RenderSettings(pixels, pixels, threads=DRAWING_THREADS)
    side = float(BALL_NODES)
    board = checkerboard((0.0, 0.0, BACKDROP_Z), (side, 0.0, 0.0), (0.0, side, 0.0), 16)
    camera = orthographic((0.0, 0.0, CAMERA_Z), (0.0, 0.0, 1.0), (0.0, -1.0, 0.0), side)
    views = made, camera, backdrop_of([board]), settings
    return Engine(
        "refraction",
        f"refractive rendering, {pixels}²",
        lambda: render(*views, None).image.astype(float),
        (lambda: render(*views, caster).image.astype(float)) if caster else None,
        float(pixels**2),
        "rays",
        None,
        ODD_PIXELS,
        5e-3,
        DRAWING_THREADS,
    )


def field(pixels: int) -> Engine:
    """A picture of two mirroring balls with geometry fields above a ground."""
    world = mirrors()
    eye = perspective((0.0, -3.4, 1.3), (0.0, 0.0, 0.5), (0.0, 0.0, 1.0), 38.0)
    settings = TraceSettings(pixels, pixels, threads=DRAWING_THREADS)
    tracer = OpenCLTracer.on_the_device(world)
    good = tracer is not None and tracer.fault_of(eye) == ""
    return Engine(
        "field",
        f"geometry field, {pixels}²",
        lambda: trace(world, eye, settings).astype(float),
        (lambda: tracer.follow(eye, settings).astype(float)) if tracer is not None and good else None,
        float(pixels**2),
        "rays with lookups",
        None,
        ODD_PIXELS,
        1e-3,
        DRAWING_THREADS,
    )


def ball() -> Floats:
    """(n, n, n) signed distance from the surface of a ball, nodes, above 0 inside."""
    axis = np.arange(BALL_NODES) - 0.5 * (BALL_NODES - 1)
    return np.asarray(BALL_RADIUS - np.sqrt(axis[:, None, None] ** 2 + axis[:, None] ** 2 + axis**2))


@cache
def glass_ball() -> Scene:
    """The ball as glass."""
    return Scene.build(Spline(ball()), Layers((0.0,), (1.0, 1.5)))


@cache
def mirrors() -> World:
    """Two balls, one a mirror and one half a mirror, on a checkerboard."""
    mesh = sphere(48, 48).in_unit_cube()
    surface = surface_of(Chart(mesh, mesh.corners[..., :2]))
    points, starts = spread_points(surface, DIVISIONS)
    inner = inner_field(INNER, starts, [build_inner_rows(surface, INNER, points)])
    shape = Shape(surface, outer_field(OUTER, [build_rows(surface, OUTER, 0, 6 * OUTER**2)]), inner)
    balls = (
        Instance(shape, placed((-0.57, 0.1, 0.55), 1.1), Material(colour=(0.85, 0.25, 0.2), mirror=0.9)),
        Instance(shape, placed((0.57, -0.15, 0.55), 1.1), Material(colour=(0.25, 0.4, 0.85), mirror=0.5)),
    )
    return world_of(FieldScene(balls, SKY, Ground(0.0, 0.5, 7.0)))
