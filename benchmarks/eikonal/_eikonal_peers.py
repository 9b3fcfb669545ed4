"""Adapters of other Eikonal solvers; packages that are not installed are omitted."""

import contextlib
import io
from collections.abc import Callable

import numpy as np

from ..shared._available import available

# Travel time from a node: (speed, spacing, node) -> times in the grid's shape.
Solver = Callable[[np.ndarray, float, tuple[int, ...]], np.ndarray]


def scikit_fmm(module) -> Solver:
    def solve(speed, spacing, node):
        front = np.ones(speed.shape)
        front[node] = 0.0
        return np.asarray(module.travel_time(front, speed, dx=spacing, order=2))

    return solve


def eikonalfm(module) -> Solver:
    return lambda speed, spacing, node: module.fast_marching(speed, node, (spacing,) * speed.ndim, 2)


def eikonalfm_factored(module) -> Solver:
    def solve(speed, spacing, node):
        steps = (spacing,) * speed.ndim
        factor = module.factored_fast_marching(speed, node, steps, 2)
        return factor * module.distance(speed.shape, steps, node, indexing="ij")

    return solve


def fteikpy(module) -> Solver:
    def solve(speed, spacing, node):
        # Its speeds belong to the cells between the nodes: the mean of the corners, as slowness.
        slowness = 1.0 / speed
        for axis in range(speed.ndim):
            n = speed.shape[axis]
            slowness = 0.5 * (slowness.take(range(1, n), axis) + slowness.take(range(n - 1), axis))
        grid = {2: module.Eikonal2D, 3: module.Eikonal3D}[speed.ndim](1.0 / slowness, (spacing,) * speed.ndim)
        return grid.solve(np.array(node) * spacing, nsweep=2).grid

    return solve


def pyekfmm(module) -> Solver:
    def solve(speed, spacing, node):
        # Its grids are (x, y, z) in Fortran order and always three-dimensional.
        shape = (*speed.shape, 1)[:3]
        source = [i * spacing for i in (*node, 0)[:3]]
        flat = np.ascontiguousarray(speed, np.float32).reshape(shape).ravel(order="F")
        with contextlib.redirect_stdout(io.StringIO()):
            time = module.eikonal(
                flat, xyz=np.array(source), ax=[0, spacing, shape[0]], ay=[0, spacing, shape[1]],
                az=[0, spacing, shape[2]], order=2,
            )  # fmt: skip
        return np.asarray(time).reshape(shape, order="F").reshape(speed.shape)

    return solve


def pyfmm_kit(module) -> Solver:
    # It warns of every source on the rim of a grid, and a plane is all rim to it.
    module.myLogger.setLevel("ERROR")

    def solve(speed, spacing, node):
        shape = (*speed.shape, 1)[:3]
        axes = [np.arange(n) * spacing for n in shape]
        source = [i * spacing for i in (*node, 0)[:3]]
        slowness = (1.0 / speed).reshape(shape)
        return module.travel_time_source(source, *axes, slowness, maxodr=2).reshape(speed.shape)

    return solve


def pykonal(module) -> Solver:
    def solve(speed, spacing, node):
        shape = (*speed.shape, 1)[:3]
        solver = module.EikonalSolver(coord_sys="cartesian")
        solver.velocity.min_coords = 0, 0, 0
        solver.velocity.node_intervals = spacing, spacing, spacing
        solver.velocity.npts = shape
        solver.velocity.values = speed.reshape(shape)
        start = (*node, 0)[:3]
        solver.traveltime.values[start] = 0.0
        solver.unknown[start] = False
        solver.trial.push(*start)
        solver.solve()
        return solver.traveltime.values.reshape(speed.shape)

    return solve


def simpleitk(module) -> Solver:
    def solve(speed, spacing, node):
        image = module.GetImageFromArray(np.ascontiguousarray(speed.T))
        image.SetSpacing((spacing,) * speed.ndim)
        march = module.FastMarchingImageFilter()
        march.SetTrialPoints([tuple(int(i) for i in node)])
        march.SetStoppingValue(1e30)
        return module.GetArrayFromImage(march.Execute(image)).T

    return solve


# Name to (module, adapter). The first seven are second order or better unless their package has none.
PEERS: dict[str, tuple[str, Callable[..., Solver]]] = {
    "scikit-fmm": ("skfmm", scikit_fmm),
    "eikonalfm": ("eikonalfm", eikonalfm),
    "eikonalfm factored": ("eikonalfm", eikonalfm_factored),
    "fteikpy": ("fteikpy", fteikpy),
    "pyekfmm": ("pyekfmm", pyekfmm),
    "pyfmm-kit": ("pyfmm", pyfmm_kit),
    "pykonal": ("pykonal", pykonal),
    "SimpleITK": ("SimpleITK", simpleitk),
}


def installed() -> tuple[dict[str, Solver], dict[str, str]]:
    """The peers that can be imported here, and why the others cannot."""
    return available(PEERS)
