"""A strong scatterer, such as a bubble: chords through one small place have lost much amplitude."""

from collections.abc import Iterator

import numpy as np

from ...arrays import Flags, Floats
from ..array_hull import depth_inside
from ..dataset import Dataset
from .finding import Finding

SCATTERER = "strong scatterer"

# Logarithm of the amplitude, relative to the usual one, of a chord in the shadow.
SHADOWED = -1.0

# Grid of places, over the width of the array, and the half-width of the chords through one, wavelengths.
PLACES, HALF_WIDTH = 41, 0.5

# Places beside the best one along each side, as far as its neighbours.
REFINED = 7

# Part of the chords through a place that are in its shadow; of those that pass it at a distance; of all.
INSIDE, OUTSIDE, MAX_SHADOW = 0.7, 0.3, 0.2

# The chords that pass it at a distance, in half-widths.
BESIDE = (4.0, 6.0)

# Fewest chords through a place.
MIN_PAIRS = 12

# Places outside this part of the array, from its middle to its faces, are crossed by few chords.
REACH = 0.85

# Pairs that are compared, drawn evenly.
MAX_PAIRS = 20_000


def find_scatterer(dataset: Dataset, log_ratio: Floats) -> Iterator[Finding]:
    """Find the place whose chords are in shadow while those that pass beside it are not.

    Args:
        dataset: of one slice, with elements in a plane and a centre frequency.
        log_ratio: (ntx, nrx), logarithm of the amplitude over that in water; NaN where unknown.
    """
    usable = np.isfinite(log_ratio) & (dataset.tx[:, None] != dataset.rx[None, :])
    if dataset.element_position_m.shape[1] != 2 or usable.sum() < MIN_PAIRS:
        return
    shadow = usable & (log_ratio - np.median(log_ratio[usable]) < SHADOWED)
    if not 0 < shadow.sum() <= MAX_SHADOW * usable.sum():
        return
    pairs = np.argwhere(usable)
    pairs = pairs[:: -(-len(pairs) // MAX_PAIRS)]
    dark = shadow[pairs[:, 0], pairs[:, 1]]
    normal, height = _lines(dataset)
    normal, height = normal[pairs[:, 0], pairs[:, 1]], height[pairs[:, 0], pairs[:, 1]]
    width = HALF_WIDTH * dataset.water_speed_mps / dataset.frequency_hz

    def darkness(line: Floats) -> float:
        """Part of the chords through a place in shadow; 0 where few cross it, or many beside it are dark."""
        off = np.abs(normal @ line - height)
        through, outside = off <= width, (off >= BESIDE[0] * width) & (off <= BESIDE[1] * width)
        if through.sum() < MIN_PAIRS or not outside.any() or dark[outside].mean() > OUTSIDE:
            return 0.0
        return float(dark[through].mean())

    coarse, spacing = _search_grid(dataset)
    line = max(coarse, key=darkness)
    steps = np.linspace(-0.5, 0.5, REFINED)
    line = max((line + spacing * np.array([x, y]) for x in steps for y in steps), key=darkness)
    best = darkness(line)
    if best < INSIDE:
        return
    normal, height = _lines(dataset)
    crossing: Flags = shadow & (np.abs(normal @ line - height) <= width)
    yield Finding(
        SCATTERER,
        f"at ({1e3 * line[0]:.0f}, {1e3 * line[1]:.0f}) mm, such as a bubble: {int(crossing.sum())} "
        "pairs through it have lost most of their amplitude",
        "an object without gas",
        "reported",
        pairs=crossing,
        value=best,
        unit="of the chords through it",
    )


def _search_grid(dataset: Dataset) -> tuple[Floats, Floats]:
    """Places inside the array, (n, 2), and their spacing, (2,), m."""
    position = dataset.element_position_m
    low, high = position.min(axis=0), position.max(axis=0)
    axes = [np.linspace(a, b, PLACES) for a, b in zip(low, high, strict=True)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
    depth = depth_inside(position, grid)
    inside = grid[depth >= (1.0 - REACH) * depth.max()]
    return np.asarray(inside), np.asarray((high - low) / (PLACES - 1))


def _lines(dataset: Dataset) -> tuple[Floats, Floats]:
    """Unit normals of all chords, (ntx, nrx, 2), and their products with the points of the chord, m."""
    start = dataset.element_position_m[dataset.tx][:, None]
    along = dataset.element_position_m[dataset.rx][None] - start
    length = np.maximum(np.linalg.norm(along, axis=-1, keepdims=True), 1e-12)
    normal = np.stack((-along[..., 1], along[..., 0]), axis=-1) / length
    return normal, np.asarray((normal * start).sum(axis=-1))
