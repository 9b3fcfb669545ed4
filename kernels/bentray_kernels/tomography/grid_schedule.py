"""Stages of a reconstruction: coarser grids before the requested one."""

from dataclasses import replace

import numpy as np
from scipy.ndimage import map_coordinates

from ..acquisition import Dataset
from ..arrays import Floats
from .problem import Problem, image_side
from .settings import Settings


def stages(dataset: Dataset, settings: Settings) -> tuple[Settings, ...]:
    """The settings of each stage, the coarsest first; each starts from the image of the previous one.

    All grids have the same side, and every coarser one half as many nodes.
    """
    coarser = settings.numerics.coarser_grids
    last = settings.changed(coarser_grids=0)
    if coarser and settings.side_m is None:
        last = replace(last, side_m=image_side(dataset, settings.grid_nodes))
    return tuple(replace(last, nodes=-(-settings.grid_nodes // 2**k)) for k in range(coarser, -1, -1))


def initial_slowness(problem: Problem, image: Floats | None = None, before: Problem | None = None) -> Floats:
    """The initial slowness of a stage, s/m: the image of the previous stage, or water everywhere.

    Args:
        problem: of the stage.
        image: of the previous stage; None for the first stage.
        before: the problem of that stage. Beyond its grid its outermost nodes are continued.
    """
    water = 1.0 / problem.water_speed
    shape = problem.region.shape
    if image is None or before is None:
        return np.full(shape, water)
    if image.shape == shape:
        return image
    lines = [
        (low + problem.spacing * np.arange(n) - lowest) / before.spacing
        for n, low, lowest in zip(shape, problem.origin, before.origin, strict=True)
    ]
    interpolated = map_coordinates(image, np.meshgrid(*lines, indexing="ij"), order=1, mode="nearest")
    return np.where(problem.region, interpolated, water)
