"""Task graph of a refinement: the same bits in any order of completion and from any checkpoint."""

import functools
import random
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bentray_kernels.task_graph import Task
from bentray_kernels.tomography import Iteration
from bentray_kernels.tomography.checkpoint import pack, unpack
from bentray_kernels.tomography.scan import MemorySource
from bentray_kernels.tomography.waveform.band_inversion import Evaluation
from bentray_kernels.tomography.waveform.inversion_state import Image
from bentray_kernels.tomography.waveform.refinement_graph import (
    RefinementGraph,
    start_band,
    starting_models,
    update_image,
)
from bentray_kernels.tomography.waveform.wave_scan import WaveScan
from bentray_kernels.tomography.waveform.waveform_checkpoint import TYPES

from ....effort import effort
from ..graph_runs import run, run_in_random_order
from .scans import RIM_MPS, SETTINGS, WATER, nodes_of, refined, scan, water, within_rim


@functools.cache
def memory_scan():
    return WaveScan(MemorySource(scan()), SETTINGS)


def begun():
    return RefinementGraph(memory_scan(), water())


def test_tasks_may_finish_in_any_order():
    found = run_in_random_order(begun(), random.Random(3))
    assert found.over
    assert np.array_equal(found.image.speed, refined().image.speed)
    assert np.array_equal(found.image.attenuation, refined().image.attenuation)


def test_progress_is_monotonic_and_history_records_the_bands():
    graph = RefinementGraph(
        memory_scan(),
        water(),
        2,
        (Iteration(2, 1, 1e-7, 24), Iteration(2, 1, 1e-7, 24, 1)),
        2,
    )
    most = sum((band.iterations + 1) * 10 for band in SETTINGS.bands)
    assert graph.total == most
    seen, tasks = [(graph.done, graph.total)], graph.first()
    while tasks:
        task = tasks.pop(0)
        tasks = graph.after(task, task.function(*task.arguments)) + tasks
        seen.append((graph.done, graph.total))
    done, totals = zip(*seen, strict=True)
    assert list(done) == sorted(done)
    # What an early end of a band saves is not made up for by a jump.
    assert list(totals) == sorted(totals, reverse=True)
    assert max(np.diff(done)) <= 2
    evaluated = [len(end.history) for end in graph.ends]
    assert done[-1] == graph.total == 10 * sum(evaluated) <= most
    assert [sweep.stage for sweep in graph.history[:2]] == [0, 1]
    for number, band in enumerate(SETTINGS.bands):
        told = [sweep for sweep in graph.history if sweep.stage == 2 + number]
        assert [sweep.sweep for sweep in told] == list(range(1, len(told) + 1))
        assert {(sweep.slice, sweep.band_hz) for sweep in told} == {(2, (band.low_hz, band.high_hz))}
        assert [(s.misfit, s.held_out_misfit) for s in told] == [
            (record.misfit, record.held) for record in graph.ends[number].history
        ]
        given = [sweep for sweep in told if sweep.given]
        measured = "held_out_misfit" if band.of == "attenuation" else "misfit"
        assert [getattr(s, measured) for s in given] == [min(getattr(s, measured) for s in told)]
        assert {sweep.of_attenuation for sweep in told} == {band.of == "attenuation"}
    # The loss leaves the residual of the speed as it was.
    assert {s.residual_rms_s for s in told} == {
        s.residual_rms_s for s in graph.history if s.stage == 3 and s.given
    }


def test_state_of_a_step_holds_no_problem():
    class Remote(WaveScan):
        def problem(self, number):
            assert self.called, "the graph asked for a problem"
            return super().problem(number)

    scan_ = Remote(MemorySource(scan()), SETTINGS)
    scan_.called = False
    graph = RefinementGraph(scan_, water())
    tasks = graph.first()
    while tasks:
        task = tasks.pop(0)
        scan_.called = True
        result = task.function(*task.arguments)
        scan_.called = False
        tasks = graph.after(task, result) + tasks
    assert np.array_equal(graph.image.speed, refined().image.speed)


def test_a_band_begins_with_the_curvature_of_the_band_before():
    graph = begun()
    tasks, curvatures, begun_with = graph.first(), [], []
    while tasks:
        task = tasks.pop(0)
        if task.function is start_band:
            curvatures.append(task.arguments[3])
        result = task.function(*task.arguments)
        tasks = graph.after(task, result) + tasks
        if task.function is start_band:
            begun_with.append(len(result.state.steps))
            # A checkpoint has the pairs once.
            assert all(end.curvature is None for end in graph.ends)
    assert curvatures[0] is None
    assert begun_with[0] == 0
    assert begun_with[1] == len(curvatures[1].steps) == SETTINGS.bands[0].iterations
    # The attenuation is another unknown.
    assert begun_with[2] == 0


def test_after_a_stop_bands_of_the_speed_are_left_out_and_the_loss_is_not():
    graph = begun()
    (task,) = graph.first()
    graph.after(task, task.function(*task.arguments))
    state = replace(
        graph.checkpoint.state, skipped=True, done=True, history=(Evaluation(1.0, 1.0, accepted=True),)
    )
    (task,) = graph.after(Task(update_image, ()), state)
    assert task.arguments[1] == 2
    assert [(end.skipped, len(end.history)) for end in graph.ends] == [(True, 1), (True, 0)]
    assert (graph.done, graph.total) == (10, 10 + (SETTINGS.bands[2].iterations + 1) * 10)


@pytest.mark.parametrize("slow", [True, False])
def test_near_the_array_the_band_begins_with_what_explains_the_scan(slow):
    """Oil of 1420 m/s that reaches the array, or an artefact of the rays in the place of water."""
    scan_of = WaveScan(MemorySource(scan(rim=slow)), SETTINGS)
    rim = np.where(within_rim(*nodes_of(water())), RIM_MPS, WATER)
    problem, band = scan_of.problem(0), start_band(scan_of, 0, replace(water(), speed=rim))
    grid = Image(problem.region, problem.band.spacing_m, problem.origin)
    fixed = ~problem.region & within_rim(*nodes_of(grid))
    assert fixed.sum() > 20
    found = band.state.image
    if slow:
        assert np.abs(found[fixed] - RIM_MPS).mean() < 15.0
    else:
        assert (found[~problem.region] == WATER).all()


def test_a_finer_grid_keeps_an_image():
    problem = memory_scan().problem(1)
    x = np.linspace(-0.03, 0.03, 60)
    image = replace(water(), speed=1500.0 + 20.0 * np.sin(200.0 * x)[:, None] * np.cos(150.0 * x)[None])
    there = problem.origin[0] + problem.band.spacing_m * np.arange(problem.region.shape[0])
    expected = 1500.0 + 20.0 * np.sin(200.0 * there)[:, None] * np.cos(150.0 * there)[None]
    assert (
        np.abs((starting_models(image, problem, SETTINGS)[0].speed - expected)[problem.region]).max() < 0.05
    )


@settings(max_examples=effort(2, 12), deadline=None)
@given(cuts=st.sets(st.integers(0, 140), min_size=1, max_size=5))
def test_a_refinement_cut_off_anywhere_ends_with_the_same_bits(cuts):
    (resumed, _), expected = run(begun, cuts, TYPES), refined()
    assert resumed.over
    assert resumed.done == resumed.total
    assert np.array_equal(resumed.image.speed, expected.image.speed)
    assert np.array_equal(resumed.image.attenuation, expected.image.attenuation)
    assert resumed.image.origin == expected.image.origin
    for end, other in zip(resumed.ends, expected.ends, strict=True):
        assert np.array_equal(end.image.speed, other.image.speed)
        assert (end.history, end.skipped) == (other.history, other.skipped)


def test_its_records_are_not_those_of_rays():
    graph, _ = run(begun)
    tree, arrays = pack(graph.checkpoint)
    with pytest.raises(KeyError):
        unpack(tree, arrays)
