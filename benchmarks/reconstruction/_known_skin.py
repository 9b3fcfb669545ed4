"""Bent rays that know the skin of the 3-D breast phantom (Li 2008, Table 7): SART from its skin alone."""

from dataclasses import replace

import numpy as np

from bentray_kernels.arrays import Floats
from bentray_kernels.tomography import Reconstruction
from bentray_kernels.tomography.problem import Problem
from bentray_kernels.tomography.sart import sart_step

from ._phantom_scan import PhantomScan
from ._table7_slices import varied

EVERY_EMITTER = 10**6


def skin_alone(coupling_mps: float, nodes: int, side_m: float) -> Floats:
    """The slice at the centre with its skin, and the coupling medium in place of all other tissue, m/s."""
    speed, bare = (varied(coupling_mps, skin).at(0.0).speed(nodes, side_m) for skin in ("skin", "no skin"))
    # Below the skin both phantoms are the same.
    return np.where(speed == bare, coupling_mps, speed)


def knowing_skin(scan: PhantomScan, like: Reconstruction) -> Reconstruction:
    """The image of SART that begins with the true skin, by the settings and on the grid of another image.

    Args:
        scan: of the slice at the centre.
        like: by SART, one slice.
    """
    nodes, coupling = like.speed.shape[0], scan.dataset.water_speed_mps
    problem = Problem.from_dataset(scan.dataset, like.settings)
    start = skin_alone(coupling, nodes, like.spacing_m[0] * (nodes - 1))
    state = sart_step.begin(1.0 / start)
    while not state.done:
        state = sart_step.advance(problem, like.settings, state, EVERY_EMITTER)
    return replace(like, speed=1.0 / state.slowness, history=state.history)
