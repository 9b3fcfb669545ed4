"""Goals V1 and V7: splines against other packages, and the gradient angles of Li 2008, chapter 3."""

from collections.abc import Callable, Iterable
from functools import partial
from itertools import pairwise

import numpy as np

from bentray_kernels.splines import Spline
from bentray_service.cli.output.benchmark_context import BenchmarkContext
from bentray_service.cli.output.benchmark_row import Row

from ..shared._timing import alternate
from ._filters_picture import picture
from ._gradient_angles import BALL_NODES, RINGS_NODES, RINGS_RADIUS, ball, rings
from ._spline_peers import installed

REPEATS, FEW_REPEATS = 15, 5

# Nodes along each axis of the volume that is read.
NODES = 64

# Times the speed of the fastest other way to read a cubic spline.
DRJIT, NDIMAGE, ND_BSPLINE = 1.25, 6.0, 40.0


def rows(context: BenchmarkContext) -> Iterable[Row]:
    """V1 and V7, with Figure 1."""
    tables: list[Callable[[bool], Iterable[Row]]] = [speed, rings_rows, ball_rows]
    for k, table in enumerate(tables):
        context.progress(k, len(tables), table.__name__)
        yield from table(context.quick)
    context.save_picture("filters.png", picture)
    context.progress(len(tables), len(tables), "done")


def speed(quick: bool) -> Iterable[Row]:
    """V1: one thread each; all read the same coefficients at the same points."""
    peers, missing = installed()
    number = 1 << (15 if quick else 18)
    for label, points in (("random", random_points(number)), ("along rays", points_along_rays(number))):
        volume = np.random.default_rng(0).uniform(-1.0, 1.0, (NODES,) * 3)
        single = Spline(volume, prefilter=False, dtype=np.float32)
        double = Spline(volume, prefilter=False)
        few = points[: number // 8]
        for name, goal, repeats, ours, given, what in (
            ("Dr.Jit", DRJIT, REPEATS, single.value_and_gradient, points, "value and gradient in float32"),
            ("ndimage", NDIMAGE, FEW_REPEATS, double.value, points, "values alone in float64"),
            (
                "NdBSpline",
                ND_BSPLINE,
                FEW_REPEATS,
                double.value_and_gradient,
                few,
                "value and gradient in float64",
            ),
        ):
            target = f"V1 {name}, {label}"
            if name in missing:
                yield Row(target, None, goal, ">=", "", missing[name])
                continue
            runs = {"ours": partial(ours, given), "theirs": peers[name](volume, given)}
            if ours == single.value_and_gradient:
                runs["double"] = partial(double.value_and_gradient, given)
            least = alternate(runs, repeats)
            detail = f"{what}, ns a point: {nanoseconds(least, len(given))}"
            yield Row(target, least["theirs"] / least["ours"], goal, ">=", "", detail)


def random_points(number: int) -> np.ndarray:
    """Anywhere within the outer nodes but one, where all packages agree on the border."""
    return np.random.default_rng(1).uniform(1.0, NODES - 2.0, (number, 3))


def points_along_rays(number: int) -> np.ndarray:
    """Steps of a quarter node along parallel rays that cross the volume aslant, one ray after the other."""
    steps = 4 * (NODES - 4)
    along = 2.0 + 0.25 * np.arange(steps)
    start = np.random.default_rng(2).uniform(2.0, NODES - 18.0, (-(-number // steps), 1, 2))
    across = np.broadcast_to(start, (len(start), steps, 2)) + 0.2 * along[:, np.newaxis]
    points = np.dstack(
        (across[..., :1], across[..., 1:], np.broadcast_to(along, across.shape[:2])[..., None])
    )
    return np.ascontiguousarray(points.reshape(-1, 3)[:number])


def nanoseconds(least: dict[str, float], number: int) -> str:
    return ", ".join(f"{name} {seconds / number * 1e9:.1f}" for name, seconds in least.items())


def rings_rows(quick: bool) -> Iterable[Row]:
    """V7, figure 6: gradients of the Marschner-Lobb signal."""
    angles = rings()
    how = f"{RINGS_NODES}³, circle of radius {RINGS_RADIUS} about z, mean of 180 angles"
    theirs = {"catmull-rom": 6.1, "bspline2": 3.69}
    for name, angle in theirs.items():
        detail = f"{angles[name]:.2f}°, theirs {angle:.2f}°; {how}"
        yield Row(f"V7 rings {name}, off theirs", abs(angles[name] - angle), 0.2, "<=", "°", detail)
    detail = f"theirs below 0.01°, reached on finer grids or nearer the axis; {how}"
    yield Row("V7 rings bspline6", angles["bspline6"], 0.2, "<=", "°", detail)
    orders = [angles[f"bspline{order}"] for order in range(2, 7)]
    listed = " > ".join(f"{angle:.2f}°" for angle in orders)
    least = min(before / after for before, after in pairwise(orders))
    yield Row("V7 rings, each order over the next", least, 1.0, ">", "", f"B-spline 2 to 6: {listed}")
    detail = f"{angles['trilinear']:.2f}°, theirs about Catmull-Rom's 6.10°; {how}"
    yield Row("V7 rings trilinear, off theirs", abs(angles["trilinear"] - 6.1), 1.0, "<=", "°", detail)
    halves = angles["half-node differences"]
    detail = (
        f"{angles['central']:.1f}° for differences between the nodes on either side, theirs about 6.10°; "
        f"{halves:.1f}° in the plane for differences of trilinear values half a node away"
    )
    yield Row("V7 rings central, off theirs", abs(angles["central"] - 6.1), 1.0, "<=", "°", detail)


def ball_rows(quick: bool) -> Iterable[Row]:
    """V7, figure 5: gradients of the 8-bit ball."""
    error = ball()
    how = f"{BALL_NODES}³ in 8 bits, plateau 0.3 and sigma 0.2 of a half edge, circle at half the value"
    detail = f"theirs below 0.01, the unit not given; {how}"
    yield Row("V7 ball smooth, λ = 1", error["smooth 1"], 0.3, "<=", "°", detail)
    detail = f"B-spline 3, λ from the noise of rounding, 1/√12 of a step; {how}"
    yield Row("V7 ball smooth, λ by the noise", error["smooth noise"], 0.3, "<=", "°", detail)
    claims = {
        "Catmull-Rom worse than trilinear": ("catmull-rom", ["trilinear"]),
        "Catmull-Rom worse than central": ("catmull-rom", ["central"]),
        "no prefiltered order better than Catmull-Rom": (
            min((f"bspline{n}" for n in range(2, 7)), key=error.__getitem__),
            ["catmull-rom"],
        ),
        "prefiltered worse than not": ("bspline2", [f"raw {n}" for n in range(2, 7)]),
        "smooth the best of all": (
            min((name for name in error if "smooth" not in name), key=error.__getitem__),
            ["smooth 1"],
        ),
    }
    for claim, (worse, better) in claims.items():
        best = max(error[name] for name in better)
        detail = f"{worse} {error[worse]:.3f}°, {', '.join(f'{name} {error[name]:.3f}°' for name in better)}"
        yield Row(f"V7 ball, {claim}", error[worse] / best, 1.0, ">", "", detail)
