"""Rays by B-spline gradients and first-order fronts in a speed of 1 + 4x, where both are known exactly."""

from collections.abc import Iterable

import numpy as np

from bentray_kernels import eikonal, rays
from bentray_kernels.requests.names import RayGradient
from bentray_service.cli.output.benchmark_row import Row

from ..shared._timing import alternate

# In the unit square; rays are arcs about centres on x = −1/4, where the speed would be 0.
SOURCE = np.array([0.2, 0.1])
RECEIVERS = np.column_stack((np.linspace(0.05, 0.95, 31), np.full(31, 0.9)))
CENTRE_X = -0.25
GRADIENTS: tuple[RayGradient, ...] = ("differences", "bspline")


def exact_times(nodes: int) -> np.ndarray:
    """Travel times from the source, s."""
    x = np.arange(nodes) / (nodes - 1)
    squared = (x[:, None] - SOURCE[0]) ** 2 + (x[None, :] - SOURCE[1]) ** 2
    return np.arccosh(1.0 + 8.0 * squared / ((1.0 + 4.0 * SOURCE[0]) * (1.0 + 4.0 * x[:, None]))) / 4.0


def times_of(method: str, nodes: int) -> np.ndarray:
    """Travel times of a method; those of "exact" are known."""
    if method == "exact":
        return exact_times(nodes)
    speed = np.repeat(1.0 + 4.0 * np.linspace(0.0, 1.0, nodes)[:, None], nodes, axis=1)
    return eikonal.solve(speed, 1.0 / (nodes - 1), SOURCE, method)


def distance_from_arcs(times: np.ndarray, gradient: RayGradient) -> float:
    """Rms distance of all points of the rays from their arcs, nodes."""
    spacing = 1.0 / (len(times) - 1)
    paths = rays.trace(times, spacing, RECEIVERS, SOURCE, gradient=gradient)
    off = []
    for path, end in zip(paths, RECEIVERS, strict=True):
        # Equally far from both ends.
        middle = np.array([CENTRE_X, 0.5 * (end[1] + SOURCE[1])])
        middle[1] += (end[0] - CENTRE_X) ** 2 / (2.0 * (end[1] - SOURCE[1]))
        middle[1] -= (SOURCE[0] - CENTRE_X) ** 2 / (2.0 * (end[1] - SOURCE[1]))
        off.append(np.linalg.norm(path - middle, axis=1) - np.linalg.norm(SOURCE - middle))
    return float(np.sqrt((np.concatenate(off) ** 2).mean()) / spacing)


def ray_rows(quick: bool) -> Iterable[Row]:
    """B-spline gradients over central differences: errors of rays by exact and by solved times, and time."""
    for nodes in (65, 129):
        for method in ("exact", "accurate", "fmm-first-order"):
            times = times_of(method, nodes)
            off = {gradient: distance_from_arcs(times, gradient) for gradient in GRADIENTS}
            ratio = off["bspline"] / off["differences"]
            detail = (
                f"rms off the arcs, nodes, {nodes}², times {method}: "
                f"{off['bspline']:.2g} by B-splines (theirs), "
                f"{off['differences']:.2g} by differences (ours)"
            )
            yield Row(f"rays by B-splines / differences, {method}, {nodes}²", ratio, 1.0, ">=", "", detail)
    times = times_of("accurate", 257)
    seconds = alternate(
        {g: lambda g=g: rays.trace(times, 1.0 / 256, RECEIVERS, SOURCE, gradient=g) for g in GRADIENTS},
        3 if quick else 7,
    )
    detail = ", ".join(f"{gradient} {1e3 * least:.1f} ms" for gradient, least in seconds.items())
    ratio = seconds["bspline"] / seconds["differences"]
    yield Row("rays by B-splines / differences, time", ratio, 1.0, ">=", "", f"31 rays, 257²: {detail}")


def front_rows(quick: bool) -> Iterable[Row]:
    """Errors of the published first-order FMM and of ours at the receivers, and how they fall."""
    # The source is a node of all of them.
    sides = (61, 121) if quick else (61, 121, 241)
    methods = ("fmm-first-order", "fmm", "hafmm", "accurate")
    error = {name: [_rms(name, nodes) for nodes in sides] for name in methods}
    for name in methods[1:]:
        ratio = error["fmm-first-order"][-1] / error[name][-1]
        orders = {
            solver: float(np.log2(error[solver][0] / error[solver][-1])) / (len(sides) - 1)
            for solver in ("fmm-first-order", name)
        }
        detail = (
            f"rms of times {sides[-1]}²: {error['fmm-first-order'][-1]:.2g} s, order "
            f"{orders['fmm-first-order']:.1f} (theirs), "
            f"{error[name][-1]:.2g} s, order {orders[name]:.1f} ({name})"
        )
        yield Row(f"first-order FMM / {name}, error", ratio, 1.0, ">=", "", detail)


def _rms(method: str, nodes: int) -> float:
    """At the receivers' line, s."""
    off = times_of(method, nodes) - exact_times(nodes)
    return float(np.sqrt((off[:, round(0.9 * (nodes - 1))] ** 2).mean()))
