"""Training and held-out parts of the emitter-receiver pairs of a scan."""

from dataclasses import replace
from typing import Literal

import numpy as np

from ..acquisition import Dataset
from ..arrays import Flags, Ints

Part = Literal["all", "shown", "held-out", "views", "shown-sparse", "views-sparse"]

# One pair in so many is held out, both directions together.
HELD_OUT = 10

# Pairs are those of at least this many emitters and receivers, where the scan has twice as many: candidates
# have half the nodes along a side, so that a quarter of the pairs are as many for each of these.
ELEMENTS = 128

# The same of sparse parts: finite-frequency rays are so wide that these pairs show as much as all.
ELEMENTS_OF_SPARSE = 64

# Views: all pairs between two sectors of the array, an eighth of it each. These three pairs of sectors
# lie across the object and hold three pairs in thirty-two.
SECTORS = 8
VIEWS = ((0, 3), (1, 6), (2, 5))


def part_of(dataset: Dataset, part: Part) -> Dataset:
    """The dataset with the pairs of one part only, the others invalid.

    A pair and its reverse belong to the same part, in all slices. ``views`` are whole views, without
    neighbours in the training part; ``held-out`` are scattered pairs outside these, whose neighbours are in
    the training part, so any smooth model predicts them well; ``shown`` are all others. ``shown-sparse`` are
    all pairs but those of ``views-sparse``. Of a scan with twice ``ELEMENTS`` or more, all parts leave out
    every second element or more, for speed; sparse ones from twice ``ELEMENTS_OF_SPARSE``.
    """
    if part == "all":
        return dataset
    views, sparse = _views(dataset), part.endswith("sparse")
    scattered = np.zeros_like(views) if sparse else _scattered(dataset) & ~views
    masks = {"shown": ~(views | scattered), "held-out": scattered, "views": views}
    least = ELEMENTS_OF_SPARSE if sparse else ELEMENTS
    selected = masks[part.removesuffix("-sparse")]
    selected &= np.logical_and.outer(_thinned(dataset.tx, least), _thinned(dataset.rx, least))
    shape = selected.shape if dataset.slice_z_m is None else (dataset.slices, *selected.shape)
    valid = np.broadcast_to(selected, shape)
    return replace(dataset, valid=valid.copy() if dataset.valid is None else valid & dataset.valid)


def _scattered(dataset: Dataset) -> Flags:
    """(ntx, nrx): scattered held-out pairs."""
    first = np.minimum(dataset.tx[:, None], dataset.rx[None, :]).astype(np.uint64)
    second = np.maximum(dataset.tx[:, None], dataset.rx[None, :]).astype(np.uint64)
    # A hash of both numbers, so that no direction or ring is held out as a whole.
    mixed = (first * np.uint64(0x9E3779B1) + second * np.uint64(0x85EBCA77)) >> np.uint64(11)
    return np.asarray((mixed % np.uint64(HELD_OUT)) == 0)


def _thinned(index: Ints, least: int) -> Flags:
    """Every second, third … of these elements, so that at least so many remain."""
    return np.asarray(np.arange(len(index)) % max(1, len(index) // least) == 0)


def _views(dataset: Dataset) -> Flags:
    """(ntx, nrx): pairs of the held-out views."""
    sector = _sectors(dataset)
    first = np.minimum(sector[dataset.tx][:, None], sector[dataset.rx][None, :])
    second = np.maximum(sector[dataset.tx][:, None], sector[dataset.rx][None, :])
    return np.asarray(np.any([(first == a) & (second == b) for a, b in VIEWS], axis=0))


def _sectors(dataset: Dataset) -> Ints:
    """(elements,): the sector in which each lies.

    Sectors are eighths of the turn about the array's middle. Where the array leaves one of them free, as an
    arc or facing lines do, they are eighths of the elements, counted from the widest gap.
    """
    flat = dataset.element_position_m[:, :2]
    x, y = (flat - 0.5 * (flat.min(axis=0) + flat.max(axis=0))).T
    # Shifted by half a millionth of a turn, so that rounding does not separate elements on an edge.
    turn = (np.arctan2(y, x) / (2.0 * np.pi) + 5e-7) % 1.0
    order = np.argsort(turn, kind="stable")
    gap = np.diff(turn[order], append=turn[order[0]] + 1.0)
    if gap.max() <= 1.0 / SECTORS:
        return np.asarray(np.floor(turn * SECTORS), dtype=np.int64)
    rank = np.empty(len(turn), dtype=np.int64)
    rank[np.roll(order, -1 - int(np.argmax(gap)))] = np.arange(len(turn))
    return rank * SECTORS // len(turn)
