"""A scan of a breast that no method here was tuned on, its travel times made by another package's solver."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from bentray_kernels.acquisition import Dataset, Truth
from bentray_kernels.acquisition.simulation.ring_scan import Ring
from bentray_kernels.phantoms import TABLE7_SIDE_M, table7
from bentray_kernels.phantoms.volume import PhantomSlice
from bentray_workers.simulation.plane import ring_radius

from ..eikonal._eikonal_peers import Solver

SIDE_M = TABLE7_SIDE_M

# How many times finer than the image the times are made; no forward model of an inversion is as fine.
REFINEMENT = 4

# Between two of the slices of Table 8, through a large lesion, a small one and two of 2 voxels.
HEIGHT_M = -0.0011

# Means of tissue in the numerical breast phantoms of Li, Villa, Park and Anastasio, "3-D stochastic numerical
# breast phantoms", IEEE TUFFC 69 (2022), m/s. In the values of Table 7 a closed skin of 1650 m/s carries the
# first arrivals round the breast: no method finds what lies inside, and water alone has the smallest error.
SPEEDS_MPS = {
    "skin": 1555.0,
    "fat": 1440.0,
    "tissue": 1520.0,
    "large lesion": 1548.0,
    "small lesion": 1548.0,
}

# The peer that makes the times.
SOLVER = "eikonalfm factored"


def breast(coupling_mps: float) -> PhantomSlice:
    """Shapes of the 3-D breast phantom between its slices, with ``SPEEDS_MPS``, in water of some speed."""
    whole = table7(coupling_mps)
    parts = tuple(replace(part, speed_mps=SPEEDS_MPS[part.name]) for part in whole.parts)
    return replace(whole, parts=parts).at(HEIGHT_M)


def fine_spacing(nodes: int) -> float:
    """Node spacing, m, of the grid that the times are made on, for an image of ``nodes`` along a side."""
    return SIDE_M / (REFINEMENT * (nodes - 1))


def positions(nodes: int, elements: int) -> np.ndarray:
    """A ring, each element moved to the nearest node of the fine grid: (elements, 2), m, centred on 0.

    Finite differences start from nodes and are read at nodes, so nothing is interpolated; every method is
    told the places as they are.
    """
    spacing = fine_spacing(nodes)
    ring = Ring(elements, ring_radius(SIDE_M, nodes)).positions()
    return np.rint(ring / spacing) * spacing


def scan(
    coupling_mps: float, nodes: int, elements: int, solve: Solver, step: Callable[[int, int], None]
) -> Dataset:
    """Travel times through ``breast``, with its image and outline.

    Args:
        coupling_mps: speed of the water, m/s.
        nodes: of the truth image along a side of ``SIDE_M``.
        elements: of the ring, each emitter and receiver.
        solve: of another package, see ``_eikonal_peers``.
        step: called after each emitter with emitters done of all.
    """
    phantom = breast(coupling_mps)
    # An even refinement: the middle of the square, where the ring is centred, is a node.
    fine, spacing = REFINEMENT * (nodes - 1) + 1, fine_spacing(nodes)
    speed = phantom.speed(fine, SIDE_M)
    position = positions(nodes, elements)
    index = np.rint(position / spacing).astype(int) + fine // 2
    delta = np.empty((elements, elements))
    for emitter, (i, j) in enumerate(index):
        tof = solve(speed, spacing, (int(i), int(j)))
        water = np.linalg.norm(position - position[emitter], axis=1) / coupling_mps
        delta[emitter] = tof[index[:, 0], index[:, 1]] - water
        step(emitter + 1, elements)
    np.fill_diagonal(delta, np.nan)
    coarse = SIDE_M / (nodes - 1)
    return Dataset(
        element_position_m=position,
        tx=np.arange(elements),
        rx=np.arange(elements),
        water_speed_mps=coupling_mps,
        delta_tof_s=delta,
        roi=phantom.inside(nodes, SIDE_M),
        truth=Truth(
            sound_speed_mps=phantom.speed(nodes, SIDE_M),
            spacing_m=(coarse, coarse),
            origin_m=(-0.5 * SIDE_M, -0.5 * SIDE_M),
        ),
    )
