"""R5 and rows 3 and 4 of Table 8: time of whole volumes slice by slice, its parts and its growth."""

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import gaussian_filter

from bentray_kernels.acquisition import Dataset
from bentray_kernels.eikonal.deviation import deviate
from bentray_kernels.phantoms import TABLE7_SIDE_M, table7
from bentray_kernels.tomography import Problem, Settings
from bentray_kernels.tomography.gauss_newton.gauss_newton_step import trace_rays
from bentray_kernels.tomography.grid_schedule import initial_slowness
from bentray_kernels.tomography.sart.emitter_pass import EmitterPass
from bentray_kernels.tomography.sart.sart_step import advance, begin
from bentray_kernels.tomography.stage_graphs import batches_of
from bentray_service.cli.output.benchmark_context import BenchmarkContext
from bentray_service.cli.output.benchmark_row import STRAIGHT_RAYS, Row
from bentray_service.cli.output.terminal import Step
from bentray_workers.cluster.connection import Cluster
from bentray_workers.simulation.plane import Ring, ring_radius
from bentray_workers.simulation.simulation_run import simulate
from bentray_workers.simulation.volume import VolumeSimulationSettings

from ..shared._baselines import Images
from ..shared._image_error import object_error
from ..shared._reconstruction_on_workers import reconstruct_file
from ..shared._timing import alternate

COUPLING_MPS = 1375.0
SWEEPS = 3

# Nodes along a side, slices, transducers, and slices that are simulated; the others repeat them.
SIZES = ((128, 40, 256, 4), (256, 44, 512, 2))
QUICK = ((64, 8, 64, 2),)

# Seconds asked for, and those of the dissertation's processors and graphics cards by the solver.
GOALS = {(128, 40): 15.0, (256, 44): 120.0}
THEIRS = {
    (128, 40): "theirs: FMM 2400, FSM 2649 (cluster 506), FIM 3316 (Tesla 30.9) s",
    (256, 44): "theirs: FMM 19200, FSM 32732 (cluster 6393), FIM 37221 (Tesla 225.76) s",
}

# Grids and arrays that the growth is fitted over, the other one kept.
NODES, ELEMENTS = (64, 96, 128, 192, 256), (64, 128, 256, 512)
QUICK_NODES, QUICK_ELEMENTS = (32, 64), (32, 64)

# Of one pass.
REPEATS = 60


def rows(context: BenchmarkContext) -> Iterable[Row]:
    """Seconds of three sweeps over a Table 7 volume on two cores, and how a sweep grows."""
    for nodes, slices, elements, distinct in QUICK if context.quick else SIZES:
        yield from volume(nodes, slices, elements, distinct, context)
        yield where(nodes, slices, elements)
    yield from growth(context.quick, context.progress)


def where(nodes: int, slices: int, elements: int) -> Row:
    """Core time of one emitter's pass, in parts, against the share of the time goal."""
    seconds = split(nodes, elements)
    goal = 1e3 * 2 * GOALS.get((nodes, slices), 10.0) / (slices * elements * SWEEPS)
    label = f"R5 one pass, {nodes}², {elements} transducers"
    return Row(label, 1e3 * seconds.whole, goal, "<=", "ms", str(seconds))


def volume(nodes: int, slices: int, elements: int, distinct: int, context: BenchmarkContext) -> Iterable[Row]:
    """One volume, and straight rays, which spend the same on everything but the front.

    The slices repeat a few, so that the error is that of these; an image that loses to a constant does not
    meet the goal, however fast it is.
    """
    with context.cluster() as cluster:
        asked = VolumeSimulationSettings(nodes, distinct, elements, COUPLING_MPS)
        what = f"simulating {distinct} slices of {nodes}²"
        few = simulate(asked, lambda now: context.progress(now.done, now.total, what), cluster.client)
        many = repeated(few, nodes, slices)
        seconds, made = {}, {}
        images = Images(
            few,
            lambda dataset, settings: (
                reconstruct_file(dataset, settings, context, cluster, "few slices", saved=True).result
            ),
        )
        for rays in ("straight", "curved"):
            settings = Settings.from_values(
                method="sart",
                rays=rays,
                nodes=nodes,
                side_m=TABLE7_SIDE_M,
                iterations=SWEEPS,
                attenuation=False,
            )
            seconds[rays] = timed(context, cluster, many, settings, f"{nodes}², {rays} rays")
            made[rays] = images.made(settings).result
        compared = images.compared(made["curved"], object_error(few, relative=True))
    passes = slices * elements * SWEEPS
    goal = GOALS.get((nodes, slices), 10.0)
    detail = (
        f"{passes} emitter passes, {1e3 * 2 * seconds['curved'] / passes:.2f} ms of a core each, "
        f"NRMSE {compared.error:.3f}; straight {seconds['straight']:.1f} s, "
        f"NRMSE {compared.baselines[STRAIGHT_RAYS]:.3f}; {distinct} slices simulated, the others repeat them"
    )
    if (nodes, slices) in THEIRS:
        detail = f"{THEIRS[nodes, slices]}; {detail}"
    label = f"R5 {nodes}² by {slices}, {elements} transducers"
    yield compared.row(label, seconds["curved"], goal, "<=", "s", detail)


def repeated(few: Dataset, nodes: int, slices: int) -> Dataset:
    """A scan of many slices that repeat a few; without its truth."""
    assert few.delta_tof_s is not None
    return replace(
        few,
        delta_tof_s=few.delta_tof_s[np.arange(slices) % len(few.delta_tof_s)],
        slice_z_m=np.arange(slices) * TABLE7_SIDE_M / (nodes - 1),
        truth=None,
        roi=None,
    )


def timed(
    context: BenchmarkContext, cluster: Cluster, dataset: Dataset, settings: Settings, what: str
) -> float:
    """Seconds of a reconstruction by both workers, compiled before."""
    assert dataset.delta_tof_s is not None
    assert dataset.slice_z_m is not None
    tiny = replace(dataset, delta_tof_s=dataset.delta_tof_s[:2], slice_z_m=dataset.slice_z_m[:2])
    reconstruct_file(tiny, replace(settings, iterations=1), context, cluster, what, saved=True)
    started = time.perf_counter()
    reconstruct_file(dataset, settings, context, cluster, what, saved=True)
    return time.perf_counter() - started


def growth(quick: bool, progress: Step) -> Iterable[Row]:
    """Exponents of a sweep's time with nodes along a side and with transducers, and bytes of its rays."""
    nodes, elements = (QUICK_NODES, QUICK_ELEMENTS) if quick else (NODES, ELEMENTS)
    times: dict[tuple[int, int], float] = {}
    sizes: dict[tuple[int, int], int] = {}
    cases = [(n, elements[0]) for n in nodes] + [(nodes[0], m) for m in elements[1:]]
    for k, (n, m) in enumerate(cases):
        progress(k, len(cases), f"growth, {n}² nodes, {m} transducers")
        times[n, m], sizes[n, m] = sweep(n, m)
    for name, unit, points in (
        ("nodes", "nodes along a side", [(n, times[n, elements[0]]) for n in nodes]),
        ("transducers", "transducers", [(m, times[nodes[0], m]) for m in elements]),
    ):
        detail = "; ".join(f"{size} {1e3 * seconds:.0f} ms" for size, seconds in points)
        detail = f"a sweep over one slice by {unit}: {detail}"
        yield Row(f"R5 growth of time with {name}", exponent(points), 2.2, "<=", "exponent", detail)
    for name, points in (
        ("nodes", [(n, sizes[n, elements[0]]) for n in nodes]),
        ("transducers", [(m, sizes[nodes[0], m]) for m in elements]),
    ):
        detail = "; ".join(f"{size} {size_b / 2**20:.1f} MiB" for size, size_b in points)
        detail = f"rays that gauss-newton keeps of one slice: {detail}"
        goal = 1.1 if name == "nodes" else 2.1
        yield Row(f"R5 growth of rays with {name}", exponent(points), goal, "<=", "exponent", detail)


def sweep(nodes: int, elements: int) -> tuple[float, int]:
    """Seconds of the second SART sweep over a slice, and bytes of the rays of Gauss–Newton through it."""
    asked = VolumeSimulationSettings(nodes, 2, elements, COUPLING_MPS)
    # Times of a wrong medium cost what those of the right one do.
    ring = asked.scan().ring
    everyone = np.arange(elements)
    random = np.random.default_rng(0).normal(0.0, 2e-7, (elements, elements))
    dataset = Dataset(ring.positions(), everyone, everyone, COUPLING_MPS, delta_tof_s=random + random.T)
    settings = Settings(method="sart", nodes=nodes, side_m=TABLE7_SIDE_M, iterations=2)
    problem = Problem.from_dataset(dataset, settings)
    state = advance(problem, settings, begin(initial_slowness(problem, None)), elements)
    started = time.perf_counter()
    state = advance(problem, settings, state, elements)
    seconds = time.perf_counter() - started
    once = problem.each_pair_once()
    blocks = [
        trace_rays(once, settings, state.slowness, emitters)
        for emitters in batches_of(once.active_emitters)[:1]
    ]
    held = sum(block.columns.nbytes + block.lengths.nbytes + block.pointers.nbytes for block in blocks)
    return seconds, held * len(batches_of(once.active_emitters))


def exponent(points: list[tuple[int, float]]) -> float:
    """Exponent of the power law that fits best in logarithms."""
    size, value = np.log(np.array(points, dtype=np.float64)).T
    return float(np.polyfit(size, value, 1)[0])


@dataclass(frozen=True)
class Split:
    """Least of some runs, s, of one emitter on one core.

    Attributes:
        front: the wave front.
        rays: everything else that an emitter takes: tracing, times, back-projection.
        update: of the image, smoothing included.
    """

    front: float
    rays: float
    update: float

    @property
    def whole(self) -> float:
        """All three."""
        return self.front + self.rays + self.update

    def __str__(self) -> str:
        seconds_of = {"wave front": self.front, "rays": self.rays, "update": self.update}
        return ", ".join(f"{name} {1e3 * seconds:.2f} ms" for name, seconds in seconds_of.items())


def split(nodes: int, elements: int) -> Split:
    """Times of a pass through the middle slice of the 3-D breast phantom in water as fast as fat."""
    spacing = TABLE7_SIDE_M / (nodes - 1)
    # As smooth as an image of SART is; the front goes round its grid more often where edges are sharp.
    slowness = 1.0 / gaussian_filter(table7(1375.0, max(nodes, 128)).at(0.0).speed(nodes, TABLE7_SIDE_M), 2.0)
    positions = Ring(elements, ring_radius(TABLE7_SIDE_M, nodes)).positions() + 0.5 * TABLE7_SIDE_M
    source, receivers = positions[0], positions[1:]
    measured = np.linalg.norm(receivers - source, axis=1) / 1375.0
    work = EmitterPass.for_grid(slowness.shape, elements)
    region, coverage = np.ones(slowness.shape, bool), np.zeros(slowness.shape)

    def look() -> None:
        work.trace(slowness, slowness, spacing, source, receivers, measured)

    def front() -> None:
        # ``look`` leaves what it gave the wave front in the first field.
        deviate(work.fields[0], source[0] / spacing, source[1] / spacing, work.front, work.fields[2])

    def update() -> None:
        work.update(slowness.copy(), coverage, region, spacing, 0.1, 1.0, (1e-4, 1e-3))

    runs: dict[str, Callable[[], object]] = {"both": look, "front": front, "update": update}
    both, first, last = alternate(runs, REPEATS).values()
    return Split(first, both - first, last)
