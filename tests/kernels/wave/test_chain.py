"""The chain of calls: the same bits in any order of finishing, and after being kept and restored."""

import random
from dataclasses import replace

import numpy as np

from bentray_kernels.tomography import Sweep
from bentray_kernels.wave.chain import WaveChain, on_grid
from bentray_kernels.wave.continuation import Here

from .scans import SETTINGS, refined, scan, water


def carried_out(chain, rng, most=None):
    """Run calls one at a time, in a random order, until the chain is over or ``most`` calls were made."""
    calls = chain.first()
    while calls and most != 0:
        call = calls.pop(rng.randrange(len(calls)))
        calls += chain.after(call, call.function(*call.arguments))
        most = None if most is None else most - 1
    return chain


def test_calls_may_finish_in_any_order():
    found = carried_out(WaveChain(Here(scan(), SETTINGS), water()), random.Random(3))
    assert found.over
    assert np.array_equal(found.image.speed, refined().image.speed)


def test_a_chain_that_was_kept_goes_on_to_the_bit():
    expected = refined()
    # In the first band, and in the second; looks that had been made are lost and made again.
    for stop in (25, 60):
        broken = carried_out(WaveChain(Here(scan(), SETTINGS), water()), random.Random(4), stop)
        assert not broken.over
        other = WaveChain(Here(scan(), SETTINGS), water())
        other.restore(broken.standing)
        carried_out(other, random.Random(5))
        assert np.array_equal(other.image.speed, expected.image.speed)
        assert other.ends[0].history == expected.bands[0].history


def test_nothing_stands_before_the_first_band():
    chain = WaveChain(Here(scan(), SETTINGS), water())
    assert chain.standing.band is None
    assert chain.standing.ends == ()
    assert not chain.over
    assert chain.image is not None
    assert chain.done == 0
    assert chain.history == ()


def test_progress_rises_to_its_end_and_history_tells_the_bands():
    chain = WaveChain(
        Here(scan(), SETTINGS), water(), 2, (Sweep(2, 1, 1e-7, 24), Sweep(2, 1, 1e-7, 24, 1)), 2
    )
    seen, calls = [chain.done], chain.first()
    while calls:
        call = calls.pop(0)
        calls = chain.after(call, call.function(*call.arguments)) + calls
        seen.append(chain.done)
    assert seen == sorted(seen)
    assert seen[-1] == chain.total == sum((band.iterations + 1) * 10 for band in SETTINGS.bands)
    assert [sweep.stage for sweep in chain.history[:2]] == [0, 1]
    for number, band in enumerate(SETTINGS.bands):
        told = [sweep for sweep in chain.history if sweep.stage == 2 + number]
        assert [sweep.sweep for sweep in told] == list(range(1, len(told) + 1))
        assert {(sweep.slice, sweep.band_hz) for sweep in told} == {(2, (band.low_hz, band.high_hz))}
        assert [(s.misfit, s.held_out_misfit) for s in told] == [
            (record.misfit, record.held) for record in chain.ends[number].history
        ]
        given = [sweep for sweep in told if sweep.given]
        assert [sweep.misfit for sweep in given] == [min(sweep.misfit for sweep in told)]


def test_the_state_that_comes_back_from_a_step_makes_no_problem_where_the_chain_is():
    class Remote(Here):
        def problem(self, number):
            assert self.called, "the chain asked for a problem"
            return super().problem(number)

    scan_ = Remote(scan(), SETTINGS)
    scan_.called = False
    chain = WaveChain(scan_, water())
    calls = chain.first()
    while calls:
        call = calls.pop(0)
        scan_.called = True
        given = call.function(*call.arguments)
        scan_.called = False
        calls = chain.after(call, given) + calls
    assert np.array_equal(chain.image.speed, refined().image.speed)


def test_nodes_outside_the_array_are_water():
    problem = Here(scan(), SETTINGS).problem(0)
    found = on_grid(replace(water(), speed=np.full((60, 60), 1550.0)), problem)
    assert (found[problem.region] == 1550.0).all()
    assert (found[~problem.region] == problem.water.speed).all()


def test_a_finer_grid_keeps_an_image():
    problem = Here(scan(), SETTINGS).problem(1)
    x = np.linspace(-0.03, 0.03, 60)
    image = replace(water(), speed=1500.0 + 20.0 * np.sin(200.0 * x)[:, None] * np.cos(150.0 * x)[None])
    there = problem.origin[0] + problem.band.spacing_m * np.arange(problem.region.shape[0])
    expected = 1500.0 + 20.0 * np.sin(200.0 * there)[:, None] * np.cos(150.0 * there)[None]
    assert np.abs((on_grid(image, problem) - expected)[problem.region]).max() < 0.05
