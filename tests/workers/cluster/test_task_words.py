"""Every task that a plan counts is told in words, never by the name of a function."""

from dataclasses import replace
from itertools import product

import pytest

from bentray_kernels.tomography import Settings
from bentray_workers.cluster.task_words import TASK_WORDS, task_in_words
from bentray_workers.files.dataset.counts import Summary, Traces
from bentray_workers.reconstruction.planning import plan
from bentray_workers.rendering.turntable import Turntable
from bentray_workers.rendering.turntable_planning import plan_turntable
from bentray_workers.simulation.request import PhantomScan
from bentray_workers.simulation.simulation_planning import plan_simulation

TRACES = Traces(64, 64, 512, 4, 2e6, 2e5, 1500.0)


def summary(traces):
    size = 0 if traces is None else 64**2 * 512 * 4
    return Summary(64, 64, 4096, 1, False, 0.0, 0.2, size, True, traces, period=True, recorded=traces)


def plans():
    shots = None, TRACES, TRACES.__class__(**{**vars(TRACES), "water_shot": False})
    for traces, method in product(shots, ("sart", "gauss-newton", "auto", "waveform")):
        if traces is not None or method != "waveform":
            settings = Settings.from_values(
                method=method, nodes=64, resolution_check=True, uncertainty=True, minutes=10.0
            )
            if method in ("sart", "gauss-newton"):
                settings = settings.changed(minutes=None)
            yield plan(summary(traces), settings, ())
    yield plan(summary(None), Settings.from_values(method="sart", nodes=64, device="opencl"), ())
    volume = Settings.from_values(
        method="sart", nodes=64, decomposition="volume", attenuation=False, blocks=4
    )
    yield plan(replace(summary(None), slices=8, height_m=0.05), volume, ())
    yield plan(
        replace(summary(TRACES), echoes=TRACES), Settings.from_values(method="sart", reflection=True), ()
    )


def test_every_task_of_a_plan_has_words():
    names = {name for planned in plans() for name in planned.call_bytes}
    names |= set(plan_simulation(PhantomScan(), ()).call_bytes)
    names |= set(plan_turntable((8, 8, 8), Turntable(), ()).call_bytes)
    assert names == set(TASK_WORDS)


def test_sentences_name_no_function():
    said = [planned.why for planned in plans()] + [plan_simulation(PhantomScan(), ()).why]
    said.append(plan_turntable((8, 8, 8), Turntable(), ()).why)
    assert all("_" not in sentence for sentence in said)
    assert all(any(f"({words})" in sentence for words in TASK_WORDS.values()) for sentence in said)


@pytest.mark.parametrize("name", ["draw_picture", "trace_rays"])
def test_words_hold_no_underscore(name):
    assert "_" not in task_in_words(name)
