"""Eikonal-SART: cuts change no bit, each pass has its order, speeds are stretched as published."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bentray_kernels.acquisition import Dataset
from bentray_kernels.acquisition.simulation.ring_scan import Ring
from bentray_kernels.phantoms import TABLE6_SIDE_M, table6
from bentray_kernels.tomography import Problem, Settings, reconstruct
from bentray_kernels.tomography.grid_schedule import initial_slowness
from bentray_kernels.tomography.sart.sart_step import advance, begin, emitter_order

from ....table6 import table6_scan

NODES, SIDE, WATER = 64, TABLE6_SIDE_M, 1375.0
PHANTOM = table6(WATER)
RING = Ring(64, 0.09)


@pytest.fixture(scope="module")
def scan():
    return table6_scan(RING.elements, NODES)


def plan(**changes):
    return Settings.from_values(nodes=NODES, side_m=SIDE, **{"method": "sart", **changes})


@given(cuts=st.lists(st.integers(1, 40), min_size=1, max_size=8))
@settings(max_examples=8, deadline=None)
def test_cutting_the_work_changes_no_bit(cuts):
    rng = np.random.default_rng(0)
    ring = Ring(16, 0.08)
    everyone = np.arange(16)
    delta = rng.normal(0.0, 2e-7, (16, 16))
    dataset = Dataset(ring.positions(), everyone, everyone, WATER, delta_tof_s=delta)
    wanted = Settings(method="sart", nodes=24, iterations=2)
    problem = Problem.from_dataset(dataset, wanted)
    whole = begin(initial_slowness(problem, None))
    while not whole.done:
        whole = advance(problem, wanted, whole, 10**6)
    cut, k = begin(initial_slowness(problem, None)), 0
    while not cut.done:
        cut = advance(problem, wanted, cut, cuts[k % len(cuts)])
        k += 1
    assert np.array_equal(whole.slowness, cut.slowness)
    assert np.array_equal(whole.coverage, cut.coverage)
    assert whole.history == cut.history


def test_same_seed_same_bits_other_seed_other_order(scan):
    a, b = reconstruct(scan, plan(iterations=1)), reconstruct(scan, plan(iterations=1))
    c = reconstruct(scan, plan(iterations=1, seed=1))
    assert np.array_equal(a.speed, b.speed)
    assert not np.array_equal(a.speed, c.speed)


def test_every_pass_slice_and_seed_has_an_order_of_its_own(scan):
    problem = Problem.from_dataset(scan, plan())
    orders = [emitter_order(problem, *which) for which in ((0, 0, 0), (0, 0, 1), (0, 1, 0), (1, 0, 0))]
    assert len({tuple(order) for order in orders}) == 4
    assert all(sorted(order) == list(range(RING.elements)) for order in orders)
