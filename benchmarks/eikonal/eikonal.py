"""Goals E1 to E11: Eikonal solvers and rays against other packages."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy.ndimage import gaussian_filter, map_coordinates

from bentray_kernels import eikonal, rays
from bentray_kernels.phantoms import TABLE6_SIDE_M, table6
from bentray_service.cli.output.benchmark_context import BenchmarkContext
from bentray_service.cli.output.benchmark_row import Row

from ..shared._timing import alternate
from ._eikonal_peers import Solver, installed
from ._reference_times import edge_times, equation_error

# Largest ring error of the one peer of first order, SimpleITK, on grad2d at 256², s.
FIRST_ORDER_S = 1.4e-2

# Width of the edges of `breast`, m.
EDGE_M = 0.6e-3


@dataclass(frozen=True)
class Problem:
    """A grid, a source node, and where and with which times errors are read."""

    name: str
    speed: np.ndarray
    spacing: float
    node: tuple[int, ...]
    receivers: np.ndarray
    exact: np.ndarray

    @property
    def source(self) -> np.ndarray:
        return np.array(self.node) * self.spacing

    def solve(self, *method: str, **options: int) -> np.ndarray:
        """Times by a method of ours, s; the default one without a name."""
        return eikonal.solve(self.speed, self.spacing, self.source, *method, **options)

    def solve_by(self, peer: Solver) -> np.ndarray:
        """Times of another package, s."""
        return peer(self.speed, self.spacing, self.node)

    def ring(self, tof: np.ndarray) -> np.ndarray:
        """Errors at the receivers, s; read by cubic interpolation, whose own error is far smaller."""
        return map_coordinates(tof, (self.receivers / self.spacing).T, order=3) - self.exact


def gradient(n: int, ndim: int) -> Problem:
    """Speed 1 to 5 along x; the exact time is known. The ring is the circle (sphere's equator) inside."""
    spacing = 1.0 / (n - 1)
    node = (round(0.1 * (n - 1)),) + (round(0.5 * (n - 1)),) * (ndim - 1)
    x = np.meshgrid(*[np.arange(n) * spacing] * ndim, indexing="ij")[0]
    angle = 2.0 * np.pi * np.arange(256) / 256
    ring = np.full((256, ndim), 0.5)
    ring[:, 0] += 0.45 * np.cos(angle)
    ring[:, 1] += 0.45 * np.sin(angle)
    source = np.array(node) * spacing
    squared = ((ring - source) ** 2).sum(axis=1)
    exact = np.arccosh(1.0 + 16.0 * squared / (2.0 * (1 + 4 * ring[:, 0]) * (1 + 4 * source[0]))) / 4.0
    return Problem(f"grad{ndim}d", 1.0 + 4.0 * x, spacing, node, ring, exact)


def breast(n: int, refinement: int, *, sharp: bool = False) -> Problem:
    """Table 6 in water 1500, a ring of 256 receivers; the reference comes from a finer grid.

    The edges are blurred by a Gaussian of ``EDGE_M``, so that both grids sample the same medium and differ
    only by the errors of the solvers. Sharp edges have a different staircase on every grid.
    """
    phantom = table6(1500.0)
    spacing = TABLE6_SIDE_M / (n - 1)
    node = (round(0.024 * (n - 1)), n // 2)
    radius = 0.5 * TABLE6_SIDE_M - node[0] * spacing
    angle = 2.0 * np.pi * np.arange(1, 256) / 256 + np.pi
    ring = 0.5 * TABLE6_SIDE_M + radius * np.column_stack((np.cos(angle), np.sin(angle)))
    slowness = 1.0 / phantom.speed(refinement * (n - 1) + 1, TABLE6_SIDE_M)
    if not sharp:
        slowness = gaussian_filter(slowness, EDGE_M * refinement / spacing)
    tof = eikonal.solve(1.0 / slowness, spacing / refinement, np.array(node) * spacing, "hafmm")
    exact = map_coordinates(tof, (ring / spacing * refinement).T, order=3)
    axis = (np.arange(n) / (n - 1) - 0.5) * TABLE6_SIDE_M
    sampled = 1.0 / slowness[::refinement, ::refinement]
    speed = phantom.speed_at(axis[:, None], axis[None, :]) if sharp else np.ascontiguousarray(sampled)
    return Problem("breast sharp" if sharp else "breast", speed, spacing, node, ring, exact)


def rows(context: BenchmarkContext) -> Iterable[Row]:
    """E1 to E11; ``quick`` covers E1 to E5 and E7 on the small problems."""
    peers, missing = installed()
    tables: list[Callable[[dict, dict, bool], Iterable[Row]]] = [
        marching,
        accurate,
        sweeping,
        along_rays,
        batches,
    ]
    if not context.quick:
        tables += [tracing, threads, three_dimensions, sharp_edges, robustness]
    for k, table in enumerate(tables):
        context.progress(k, len(tables), table.__name__)
        yield from table(peers, missing, context.quick)
    context.progress(len(tables), len(tables), "done")


def against(
    target: str,
    peers: dict,
    missing: dict,
    names: Iterable[str],
    p: Problem,
    ours: Callable[[], object],
    goal: float,
) -> Iterable[Row]:
    """A row per peer: its time over ours on one problem."""
    for name in names:
        if name not in peers:
            yield Row(f"{target} {name}", None, goal, ">=", "", missing[name])
            continue
        peer = peers[name]
        least = alternate({"ours": ours, name: partial(p.solve_by, peer)})
        detail = (
            f"{p.name} {p.speed.shape}: ours {least['ours'] * 1e3:.2f} ms, {name} {least[name] * 1e3:.2f} ms"
        )
        yield Row(f"{target} {name}", least[name] / least["ours"], goal, ">=", "", detail)


def marching(peers: dict, missing: dict, quick: bool) -> Iterable[Row]:
    """E1: heap fast marching, second order."""
    p = gradient(256, 2)
    ours = partial(p.solve, "fmm")
    yield from against("E1 speed", peers, missing, ("scikit-fmm", "pyfmm-kit"), p, ours, 2.0)
    yield from against("E1 speed", peers, missing, ("eikonalfm",), p, ours, 1.2)
    for name in ("eikonalfm", "scikit-fmm", "pyfmm-kit"):
        if name in peers:
            gap = float(np.abs(p.solve_by(peers[name]) - ours()).max())
            yield Row(
                f"E1 equals {name}", gap, 1e-10, "<=", "s", "largest difference on grad2d 256², time 0.8 s"
            )
        else:
            yield Row(f"E1 equals {name}", None, 1e-10, "<=", "s", missing[name])


def accurate(peers: dict, missing: dict, quick: bool) -> Iterable[Row]:
    """E2: the default solver against factored eikonalfm."""
    name = "eikonalfm factored"
    for n, goal in ((256, 2.5),) if quick else ((256, 2.5), (1024, 2.0)):
        p = gradient(n, 2)
        yield from against(f"E2 speed {n}²", peers, missing, (name,), p, p.solve, goal)
        if name in peers:
            theirs = np.abs(p.ring(p.solve_by(peers[name]))).max()
            error = np.abs(p.ring(p.solve())).max()
            detail = f"largest ring error: ours {error:.2e} s, theirs {theirs:.2e} s"
            yield Row(f"E2 error {n}²", error / theirs, 1.02, "<=", "", detail)


def sweeping(peers: dict, missing: dict, quick: bool) -> Iterable[Row]:
    """E3: first-order fast sweeping against the defaults of the peers."""
    problems = [(gradient(256, 2), 3.0)]
    if not quick:
        problems += [(gradient(1024, 2), 4.0), (gradient(128, 3), 4.0)]
    for p, goal in problems:
        size = f"{p.speed.shape[0]}" + {2: "²", 3: "³"}[p.speed.ndim]
        ours = partial(p.solve, "fsm")
        yield from against(
            f"E3 {size}", peers, missing, [n for n in peers if n != "eikonalfm factored"], p, ours, goal
        )
        if size == "256²":
            error, default = (float(np.abs(p.ring(tof)).max()) for tof in (ours(), p.solve()))
            detail = f"largest ring error, grad2d; the default solver, of second order, has {default:.1e} s"
            yield Row(f"E3 {size}, first order, error", error, FIRST_ORDER_S, "<=", "s", detail)
        for name in missing:
            yield Row(f"E3 {size} {name}", None, goal, ">=", "", missing[name])


def ray_times(p: Problem, **options: int) -> np.ndarray:
    """Travel times read as the integral of the slowness along bent rays."""
    tof = p.solve(**options)
    return rays.travel_times(tof, p.speed, p.spacing, p.receivers, p.source)


def rms(values: np.ndarray) -> float:
    return float(np.sqrt((values**2).mean()))


def along_rays(peers: dict, missing: dict, quick: bool) -> Iterable[Row]:
    """E4 and E5: accuracy and time with rays on the breast."""
    p = breast(256, 4 if quick else 8)
    errors = {n: rms(p.ring(p.solve_by(f))) for n, f in peers.items()}
    if not errors:
        yield Row("E4 error", None, 0.5, "<=", "", "no peer is installed")
        return
    best = min(errors, key=errors.__getitem__)
    listed = ", ".join(f"{n} {e * 1e9:.1f}" for n, e in errors.items())
    ours = rms(ray_times(p) - p.exact)
    detail = f"ring rms, ns: ours {ours * 1e9:.2f}; {listed}"
    least = alternate({"ours": lambda: ray_times(p), best: partial(p.solve_by, peers[best])})
    seconds = f"ours {least['ours'] * 1e3:.1f} ms with 255 rays, {best} {least[best] * 1e3:.1f} ms without"
    # Bent rays are the high-accuracy mode: supersampling their travel time does not change the result.
    finer = rms(ray_times(p, supersample=2) - p.exact)
    for target, error_goal, time_goal in (("E4", 0.5, 1.0), ("E5", 0.15, 2.5)):
        yield Row(f"{target} error", ours / errors[best], error_goal, "<=", "", detail)
        detail = f"{detail}; ours guided by a front on 2 times finer nodes {finer * 1e9:.2f}"
        yield Row(f"{target} time", least["ours"] / least[best], time_goal, "<=", "", seconds)


def batches(peers: dict, missing: dict, quick: bool) -> Iterable[Row]:
    """E7: many sources in one call, one core."""
    p = gradient(256, 2)
    sources = np.random.default_rng(0).uniform(0.05, 0.95, (64, 2))
    if "scikit-fmm" not in peers:
        yield Row("E7 lanes", None, 12.0, ">=", "", missing["scikit-fmm"])
        return
    least = alternate(
        {
            "ours": lambda: eikonal.solve_many(p.speed[None], p.spacing, sources, "fsm"),
            "peer": partial(p.solve_by, peers["scikit-fmm"]),
        }
    )
    each = least["ours"] / len(sources)
    detail = f"grad2d 256²: ours {each * 1e3:.2f} ms a solve, scikit-fmm {least['peer'] * 1e3:.2f} ms"
    yield Row("E7 lanes", least["peer"] / each, 12.0, ">=", "", detail)
    yield Row(
        "E7 projection",
        each * 1e3,
        0.7,
        "<=",
        "ms",
        "a 256² projection in lanes on one core; the Tesla took 2.2 ms",
    )


def tracing(peers: dict, missing: dict, quick: bool) -> Iterable[Row]:
    """E6: 255 rays, how straight they are, and the sensitivities."""
    p = breast(256, 4)
    tof = p.solve()
    paths = rays.trace(tof, p.spacing, p.receivers, p.source)
    lost = sum(not np.allclose(path[-1], p.source) for path in paths)
    yield Row("E6 lost rays", lost, 0, "<=", "", "of 255, breast 256²")
    flat = eikonal.solve(np.full((256, 256), 1500.0), p.spacing, p.source)
    off = 0.0
    for path, receiver in zip(rays.trace(flat, p.spacing, p.receivers, p.source), p.receivers, strict=True):
        along = (p.source - receiver) / np.linalg.norm(p.source - receiver)
        side = path - receiver
        off = max(off, float(np.abs(side[:, 0] * along[1] - side[:, 1] * along[0]).max() / p.spacing))
    yield Row("E6 straightness", off, 0.05, "<=", "cells", "largest distance from the straight line in water")
    matrix = rays.sensitivities(tof, p.spacing, p.receivers, p.source)
    slowness = 1.0 / p.speed
    integral = []
    for path in paths:
        # Half steps, as the sensitivities take them.
        length = 0.5 * np.linalg.norm(np.diff(path, axis=0), axis=1)
        read = [
            map_coordinates(slowness, ((path[:-1] + q * np.diff(path, axis=0)) / p.spacing).T, order=1)
            for q in (0.25, 0.75)
        ]
        integral.append(length @ sum(read))
    gap = np.linalg.norm(matrix @ slowness.ravel() - integral) / np.linalg.norm(integral)
    yield Row(
        "E6 sensitivities times slowness", float(gap), 1e-12, "<=", "", "against the integral along the paths"
    )
    least = alternate(
        {
            "paths": lambda: rays.trace(tof, p.spacing, p.receivers, p.source),
            "matrix": lambda: rays.sensitivities(tof, p.spacing, p.receivers, p.source),
        }
    )
    more = (least["matrix"] - least["paths"]) * 1e3
    yield Row(
        "E6 sensitivities", more, 1.0, "<=", "ms", f"more than the {least['paths'] * 1e3:.2f} ms of the paths"
    )
    if "fteikpy" in peers:
        import fteikpy

        grid = fteikpy.Eikonal2D(p.speed[1:, 1:], (p.spacing, p.spacing)).solve(
            p.source, return_gradient=True
        )
        pair = alternate(
            {
                "ours": lambda: rays.trace(tof, p.spacing, p.receivers, p.source),
                "theirs": lambda: grid.raytrace(p.receivers, stepsize=0.5 * p.spacing, max_step=4096),
            }
        )
        detail = f"255 rays: ours {pair['ours'] * 1e3:.2f} ms, fteikpy {pair['theirs'] * 1e3:.2f} ms"
        yield Row("E6 time", pair["ours"] / pair["theirs"], 0.4, "<=", "", detail)
    else:
        yield Row("E6 time", None, 0.4, "<=", "", missing["fteikpy"])


def threads(peers: dict, missing: dict, quick: bool) -> Iterable[Row]:
    """E8: two threads over sources."""
    p = gradient(256, 2)
    sources = np.random.default_rng(0).uniform(0.05, 0.95, (64, 2))
    least = alternate(
        {str(k): lambda k=k: eikonal.solve_many(p.speed[None], p.spacing, sources, threads=k) for k in (1, 2)}
    )
    detail = f"64 sources, default method: {least['1'] * 1e3:.0f} ms, then {least['2'] * 1e3:.0f} ms"
    yield Row("E8 two threads", least["1"] / least["2"], 1.8, ">=", "", detail)


def three_dimensions(peers: dict, missing: dict, quick: bool) -> Iterable[Row]:
    """E9: factored second order, 128³."""
    p, name = gradient(128, 3), "eikonalfm factored"
    yield from against("E9 speed", peers, missing, (name,), p, p.solve, 2.0)
    if name in peers:
        theirs = np.abs(p.ring(p.solve_by(peers[name]))).max()
        error = np.abs(p.ring(p.solve())).max()
        yield Row(
            "E9 error",
            error / theirs,
            1.02,
            "<=",
            "",
            f"largest ring error: {error:.2e} s against {theirs:.2e} s",
        )


def sharp_edges(peers: dict, missing: dict, quick: bool) -> Iterable[Row]:
    """E10: the breast without anti-aliasing."""
    p = breast(256, 8, sharp=True)
    error = rms(ray_times(p) - p.exact)
    if "fteikpy" not in peers:
        yield Row("E10 sharp edges", None, 1.0, "<=", "", missing["fteikpy"])
        return
    theirs = rms(p.ring(p.solve_by(peers["fteikpy"])))
    detail = f"ring rms: ours along rays {error * 1e9:.0f} ns, fteikpy {theirs * 1e9:.0f} ns"
    yield Row("E10 sharp edges", error / theirs, 1.0, "<=", "", detail)


# Largest relative difference of first-order times from their equation. Untidy marching takes nodes of one
# bucket in any order, which costs some accuracy.
EXACT, UNTIDY = 1e-9, 1e-3

# Where the speed varies over decades, second differences make less of the first-order time, but no less than
# a quarter. Factored updates beside the source's cell take the way from its earliest node, which may be
# slower than the shortest one along edges, by less than a quarter.
LEAST, LATEST = 0.25, 1.25


def robustness(peers: dict, missing: dict, quick: bool) -> Iterable[Row]:
    """E11: every method on 10,000 rough models, its times against a reference."""
    rng = np.random.default_rng(0)
    failures, wrong, worst = 0, 0, {"first": 0.0, "fmm-untidy": 0.0}
    runs = [(name, {}) for name in eikonal.methods()] + [("fmm", {"order": 1}), ("fmm-untidy", {"order": 1})]
    for k in range(10_000):
        shape = tuple(rng.integers(1, 12, 2 + k % 2))
        speed = 10.0 ** rng.uniform(-2.0, 2.0, shape)
        source = rng.uniform(0.0, 1.0, len(shape)) * (np.array(shape) - 1)
        # Checked against its own equation below.
        earliest = LEAST * eikonal.solve(speed, 1.0, source, "fsm")
        latest = LATEST * edge_times(speed, source)
        for method, options in runs:
            if method == "fim-opencl" and k >= 100:
                continue
            tof = eikonal.solve(speed, 1.0, source, method, **options)
            if not (np.isfinite(tof).all() and (tof >= 0.0).all()):
                failures += 1
            elif options.get("order", eikonal.METHODS[method].order) == 1:
                error = equation_error(tof, speed, source)
                kind = method if method in worst else "first"
                worst[kind] = max(worst[kind], error)
                wrong += error > (UNTIDY if kind == method else EXACT)
            else:
                wrong += bool(((tof < earliest * (1.0 - EXACT)) | (tof > latest * (1.0 + EXACT))).any())
    models = "10,000 rough models, speeds over four decades"
    methods = ", ".join(eikonal.methods())
    yield Row("E11 failures", failures, 0, "<=", "", f"{models}; {methods} (OpenCL 100)")
    yield Row(
        "E11 wrong times",
        wrong,
        0,
        "<=",
        "",
        f"{models}; first order against its equation in NumPy: largest relative error {worst['first']:.0e}, "
        f"fmm-untidy {worst['fmm-untidy']:.0e}; second order between a quarter of it "
        "and 1.25 of the time along edges of the grid",
    )
