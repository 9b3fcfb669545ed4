"""Several slices at once: each as if alone, and as ``sart.advance`` would have it."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bentray_kernels.acquisition import Dataset
from bentray_kernels.acquisition.simulation import Ring, TravelTimeScan
from bentray_kernels.errors import InvalidInput
from bentray_kernels.phantoms import TABLE6_SIDE_M, table6
from bentray_kernels.tomography import Problem, Settings
from bentray_kernels.tomography.lanes import advance_many
from bentray_kernels.tomography.sart import advance, begin

NODES, WATER = 64, 1375.0
RING = Ring(64, 0.09)


def water(problem):
    return begin(np.full(problem.region.shape, 1.0 / problem.water_speed))


def same(one, other):
    return (
        np.array_equal(one.slowness, other.slowness)
        and np.array_equal(one.coverage, other.coverage)
        and np.array_equal(one.residuals, other.residuals)
        and one.history == other.history
        and one.squares == other.squares
        and (one.sweep, one.emitter, one.count, one.done)
        == (other.sweep, other.emitter, other.count, other.done)
    )


@pytest.fixture(scope="module")
def scan():
    everyone = np.arange(RING.elements)
    data = TravelTimeScan(table6(WATER), RING, TABLE6_SIDE_M, nodes=NODES).delta_tof(everyone)
    return Dataset(RING.positions(), everyone, everyone, WATER, delta_tof_s=data)


def plan(**changes):
    return Settings(nodes=NODES, side_m=TABLE6_SIDE_M, **changes)


def noise(slices):
    """Small slices of noise, each with other missing pairs, and settings for them."""
    ring, everyone, wanted = Ring(16, 0.08), np.arange(16), Settings(nodes=24, sweeps=2, subset=3)
    problems = []
    for k in range(slices):
        rng = np.random.default_rng(k)
        delta = rng.normal(0.0, 2e-7, (16, 16))
        delta[rng.uniform(size=(16, 16)) < 0.1 * k] = np.nan
        problems.append(
            Problem.of(Dataset(ring.positions(), everyone, everyone, WATER, delta_tof_s=delta), wanted)
        )
    return problems, wanted


@given(cuts=st.lists(st.integers(1, 40), min_size=1, max_size=6), together=st.integers(1, 4))
@settings(max_examples=10, deadline=None)
def test_neither_company_nor_cuts_change_a_bit(cuts, together):
    problems, wanted = noise(together)
    alone = []
    for k, problem in enumerate(problems):
        state = water(problem)
        while not state.done:
            (state,) = advance_many([problem], wanted, [state], 10**6, [k])
        alone.append(state)
    states, turn = [water(problem) for problem in problems], 0
    while not all(state.done for state in states):
        states = advance_many(problems, wanted, states, cuts[turn % len(cuts)], range(together))
        turn += 1
    assert all(same(one, other) for one, other in zip(alone, states, strict=True))
    assert states == advance_many(problems, wanted, states, 5, range(together))


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"rays": "straight"},
        {"subset": 4, "relaxation": 0.4, "huber_s": 2e-7},
        {"speed_update": "data-driven", "speed_range_mps": (1375.0, 1560.0), "relaxation_decay": 0.5},
        {"front_smoothing_nodes": 1.5, "smoothing_nodes": 1.5},
    ],
)
def test_images_are_those_of_the_slower_way(scan, changes):
    wanted = plan(sweeps=2, **changes)
    problem = Problem.of(scan, wanted)
    slow = fast = water(problem)
    while not slow.done:
        slow = advance(problem, wanted, slow, 10**6)
        (fast,) = advance_many([problem], wanted, [fast], 10**6, [0])
    inside = problem.region
    apart = np.abs(1.0 / fast.slowness - 1.0 / slow.slowness)[inside]
    spread = np.std(1.0 / slow.slowness[inside])
    assert apart.mean() < 0.03 * spread
    assert fast.history[-1].residual_rms_s == pytest.approx(slow.history[-1].residual_rms_s, rel=0.05)
    assert fast.coverage.sum() == pytest.approx(slow.coverage.sum(), rel=1e-2)
    assert fast.history[-1].emitters == slow.history[-1].emitters == RING.elements
    assert abs(fast.residuals.sum() - slow.residuals.sum()) == 0


def test_states_are_left_as_they_are(scan):
    problem = Problem.of(scan, plan())
    state = water(problem)
    before = state.slowness.copy(), state.coverage.copy()
    advance_many([problem], plan(), [state], 2, [0])
    assert np.array_equal(state.slowness, before[0])
    assert np.array_equal(state.coverage, before[1])


def test_what_does_not_fit_is_named(scan):
    problem = Problem.of(scan, plan())
    other = Problem.of(scan, replace(plan(), nodes=32))
    volume = replace(problem, region=problem.region[:, :, None])
    state = water(problem)
    for problems, states, field in (
        ([problem], [state, state], "states"),
        ([problem, other], [state, water(other)], "problems"),
        ([volume], [state], "problems"),
    ):
        with pytest.raises(InvalidInput) as refused:
            advance_many(problems, plan(), states, 1, range(len(problems)))
        assert refused.value.field == field
    assert advance_many([], plan(), [], 1, []) == []
