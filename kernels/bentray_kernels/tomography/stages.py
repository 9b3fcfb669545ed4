"""The stages of a reconstruction: coarser grids and straight rays that come before what was asked for."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.ndimage import map_coordinates

from ..acquisition import Dataset
from ..arrays import Floats
from .problem import Problem, image_side
from .settings import Settings


def stages(dataset: Dataset, settings: Settings) -> tuple[Settings, ...]:
    """The settings of each stage, the coarsest first; each begins with the image of the one before.

    All grids have the same side, and every coarser one half as many nodes. Straight rays come first, on the
    coarsest grid.
    """
    last = replace(settings, coarser_grids=0, straight_sweeps=0)
    if settings.coarser_grids and settings.side_m is None:
        last = replace(last, side_m=image_side(dataset, settings.nodes))
    found = [replace(last, nodes=-(-settings.nodes // 2**k)) for k in range(settings.coarser_grids, -1, -1)]
    if settings.straight_sweeps and settings.rays == "curved":
        found.insert(0, replace(found[0], rays="straight", sweeps=settings.straight_sweeps))
    return tuple(found)


def start(problem: Problem, before: Floats | None) -> Floats:
    """The slowness that a stage begins with, s/m: the image of the stage before, or water everywhere.

    Both grids have the same side, so a node's place is the same part of the axis in both; along z, where
    they may differ in height, the outermost nodes are repeated.
    """
    water = 1.0 / problem.water_speed
    shape = problem.region.shape
    if before is None:
        return np.full(shape, water)
    if before.shape == shape:
        return before
    scale = (before.shape[0] - 1) / (shape[0] - 1)
    middle = [0.5 * (n - 1) for n in shape]
    places = [
        0.5 * (old - 1) + scale * (np.arange(n) - centre)
        for old, n, centre in zip(before.shape, shape, middle, strict=True)
    ]
    found = map_coordinates(before, np.meshgrid(*places, indexing="ij"), order=1, mode="nearest")
    return np.where(problem.region, found, water)
