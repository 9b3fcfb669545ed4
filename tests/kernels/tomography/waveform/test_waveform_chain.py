"""The chain of calls: the same bits in any order of finishing, and after being kept and restored."""

import random
from dataclasses import replace

import numpy as np

from bentray_kernels.tomography import Sweep
from bentray_kernels.tomography.task_chains import Call
from bentray_kernels.tomography.waveform.band_inversion import WavePass
from bentray_kernels.tomography.waveform.frequency_continuation import Here
from bentray_kernels.tomography.waveform.waveform_chain import WaveChain, on_grid, step_by_waves

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
    assert np.array_equal(found.image.attenuation, refined().image.attenuation)


def test_a_chain_that_was_kept_goes_on_to_the_bit():
    expected = refined()
    # In the first band, in the second and in that of the loss; looks that wait are lost and made again.
    for stop in (25, 60, 115):
        broken = carried_out(WaveChain(Here(scan(), SETTINGS), water()), random.Random(4), stop)
        assert not broken.over
        other = WaveChain(Here(scan(), SETTINGS), water())
        other.restore(broken.standing)
        carried_out(other, random.Random(5))
        assert np.array_equal(other.image.speed, expected.image.speed)
        assert np.array_equal(other.image.attenuation, expected.image.attenuation)
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
        measured = "held_out_misfit" if band.of == "attenuation" else "misfit"
        assert [getattr(s, measured) for s in given] == [min(getattr(s, measured) for s in told)]
        assert {sweep.of_attenuation for sweep in told} == {band.of == "attenuation"}
    # The loss leaves the residual of the speed as it was.
    assert {s.residual_rms_s for s in told} == {
        s.residual_rms_s for s in chain.history if s.stage == 3 and s.given
    }


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


def test_after_a_stop_bands_of_the_speed_are_left_out_and_the_loss_is_not():
    chain = WaveChain(Here(scan(), SETTINGS), water())
    (call,) = chain.first()
    chain.after(call, call.function(*call.arguments))
    state = replace(chain.standing.state, skipped=True, done=True, history=(WavePass(1.0, 1.0, taken=True),))
    (call,) = chain.after(Call(step_by_waves, ()), state)
    assert call.arguments[1] == 2
    assert [(end.skipped, len(end.history)) for end in chain.ends] == [(True, 1), (True, 0)]
    assert chain.done == sum((band.iterations + 1) * 10 for band in SETTINGS.bands[:2])


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
