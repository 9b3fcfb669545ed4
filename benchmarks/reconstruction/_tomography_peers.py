"""Others that reconstruct speed from travel times, behind one call each; a missing one is left out."""

import importlib
import logging
from collections.abc import Callable
from functools import partial

import numpy as np
from scipy.interpolate import LinearNDInterpolator
from scipy.sparse import csr_array, vstack
from scipy.sparse.linalg import lsqr

from ..shared._available import available
from ._straight_ray_peers import cgls, roughness, sart, sirt
from ._travel_times import TravelTimes

# Speed, (nodes, nodes) m/s, of the slice; pairs without a travel time are not used.
Peer = Callable[[TravelTimes], np.ndarray]

# Strengths here and in ``_straight_ray_peers`` are the best of a few tried on the very slice they are judged
# by, in water 1500: in favour of the peers.
SPEED_BOUNDS_MPS = (1300.0, 1800.0)

# Largest triangle, squares of the nodes' spacing, of a coarse and of a fine mesh: 16 gives 2830 triangles for
# an image of 128 nodes and 256 elements, many because elements are corners. Four times as many take five
# times as long. An image of 64 nodes has too few: 31.8 m/s, where a largest triangle of 4 gives 22.6.
PYGIMLI_COARSE, PYGIMLI_FINE = 16.0, 8.0
PYGIMLI_SECONDARY_NODES = 2
# It weighs the roughness against a sum over pairs. For the 2016 pairs of 64 elements this is its default, 20,
# which did better than 5; 20 for 256 elements gave 34.5 m/s. L1 roughness changed little.
PYGIMLI_ERROR_S, PYGIMLI_STRENGTH_A_PAIR = 50e-9, 0.01

# Roughness of the first and the last iterations. Constant ones did no better: 0.01 stops early, 0.001 and
# 0.00035 gave 25.5 and 24.8 m/s on 64² nodes where this gives 23.7, and 0.0001 diverged.
TTCRPY_ROUGHNESS = (0.005, 0.0004)
# Points on an edge of a cell; its default of 10 takes three times as long for the same error.
TTCRPY_NODES = 5
TTCRPY_WEAKENING, TTCRPY_ITERATIONS, TTCRPY_LEAST_GAIN = 0.35, 12, 0.02


def straight(method: Peer) -> Callable[..., Peer]:
    return lambda _: method


def pygimli(module, error_s: float = PYGIMLI_ERROR_S, area: float = PYGIMLI_COARSE) -> Peer:
    """pyGIMLi's own inversion: a shortest-path graph on triangles whose corners include the elements.

    Its times along the graph are up to a per cent long. So that this is no error of the data, it is given its
    own times through water plus the measured differences: 23.0 m/s on 64² nodes instead of 28.4. It starts
    from water and ends when it gains less than 1 %, as it does by default.
    """
    meshtools = importlib.import_module("pygimli.meshtools")
    traveltime = importlib.import_module("pygimli.physics.traveltime")

    def solve(times):
        module.setLogLevel(logging.ERROR)
        module.setThreadCount(1)
        sensors, sensor = np.unique(
            np.concatenate((times.emitters, times.receivers)), axis=0, return_inverse=True
        )
        x, y = (sensors - sensors.mean(axis=0)).T
        round_the_ring = np.argsort(np.arctan2(y, x))
        outline = meshtools.createPolygon(
            sensors[round_the_ring], isClosed=True, area=area * times.spacing**2
        )
        mesh = meshtools.createMesh(outline, quality=34)
        emitter, receiver = times.pairs()
        data = module.DataContainer()
        for name in "sg":
            data.registerSensorIndex(name)
        for sensor_xy in sensors:
            data.createSensor(list(sensor_xy))
        data.resize(emitter.size)
        data["s"] = sensor[emitter]
        data["g"] = sensor[len(times.emitters) + receiver]
        data["valid"] = np.ones(emitter.size)
        water = 1.0 / times.water_speed
        through_water = traveltime.TravelTimeManager(data).simulate(
            mesh=mesh,
            scheme=data,
            slowness=np.full(mesh.cellCount(), water),
            secNodes=PYGIMLI_SECONDARY_NODES,
            returnArray=True,
        )
        data["t"] = np.asarray(through_water) + times.delta_tof[emitter, receiver]
        data["err"] = np.full(emitter.size, error_s)
        manager = traveltime.TravelTimeManager(data)
        speed = manager.invert(
            mesh=mesh,
            useGradient=False,
            startModel=water,
            secNodes=PYGIMLI_SECONDARY_NODES,
            limits=list(SPEED_BOUNDS_MPS),
            lam=PYGIMLI_STRENGTH_A_PAIR * emitter.size,
        )
        centres = np.array([(c.center().x(), c.center().y()) for c in manager.paraDomain.cells()])
        return _on_nodes(times, centres, np.asarray(speed))

    return solve


def _on_nodes(times: TravelTimes, points: np.ndarray, speed: np.ndarray) -> np.ndarray:
    """Values at scattered places read linearly at the nodes; water outside their hull."""
    axis = np.arange(times.region.shape[0]) * times.spacing
    nodes = np.stack(np.meshgrid(axis, axis, indexing="ij"), axis=-1)
    return np.asarray(LinearNDInterpolator(points, speed, fill_value=times.water_speed)(nodes))


def ttcrpy(module) -> Peer:
    """Gauss-Newton on ttcrpy's shortest paths and sensitivities, with a roughness that weakens.

    It starts from water; as for pyGIMLi, the times are its own through water plus the differences. It ends,
    once the roughness is at its weakest, when the misfit falls by less than ``TTCRPY_LEAST_GAIN``, and gives
    the image that fits best.
    """

    def solve(times):
        nodes = times.region.shape[0]
        # Its slowness belongs to cells; their middles are the image's nodes.
        edges = (np.arange(nodes + 1) - 0.5) * times.spacing
        grid = module.Grid2d(edges, edges, n_threads=1, nsnx=TTCRPY_NODES, nsnz=TTCRPY_NODES)
        emitter, receiver = times.pairs()
        ends = times.emitters[emitter], times.receivers[receiver]
        water = 1.0 / times.water_speed
        measured = grid.raytrace(*ends, np.full((nodes, nodes), water)) + times.delta_tof[emitter, receiver]
        inside = times.region.ravel()
        strength, weakest = TTCRPY_ROUGHNESS
        least, best = np.inf, np.zeros(np.count_nonzero(inside))
        change = best
        for _ in range(TTCRPY_ITERATIONS):
            predicted, matrix = grid.raytrace(*ends, 1.0 / times.speed(change), compute_L=True)
            residual = measured - predicted
            misfit = float(np.sqrt((residual**2).mean()))
            gained = misfit < (1.0 - TTCRPY_LEAST_GAIN) * least
            if misfit < least:
                least, best = misfit, change
            if not gained and strength == weakest:
                break
            matrix = csr_array(matrix)[:, inside]
            rough = roughness(times, strength)
            wanted = np.concatenate((residual, -(rough @ change)))
            step = lsqr(vstack((matrix, rough), format="csr"), wanted, atol=1e-4, btol=1e-4, iter_lim=200)[0]
            fastest, slowest = (1.0 / speed - water for speed in SPEED_BOUNDS_MPS[::-1])
            change = np.clip(change + step, fastest, slowest)
            strength = max(weakest, TTCRPY_WEAKENING * strength)
        return times.speed(best)

    return solve


# Name to (module, adapter).
PEERS: dict[str, tuple[str, Callable[..., Peer]]] = {
    "straight CGLS": ("scipy.sparse", straight(cgls)),
    "straight SIRT": ("scipy.sparse", straight(sirt)),
    "straight SART": ("scipy.sparse", straight(sart)),
    "pyGIMLi": ("pygimli", pygimli),
    "pyGIMLi, fine mesh": ("pygimli", partial(pygimli, area=PYGIMLI_FINE)),
    "ttcrpy + Gauss-Newton": ("ttcrpy.rgrid", ttcrpy),
}


def installed() -> tuple[dict[str, Peer], dict[str, str]]:
    """The peers that can be imported here, and why the others cannot."""
    return available(PEERS)
