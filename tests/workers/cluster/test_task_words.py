"""What is told of tasks: their words, the progress of a job, and one line for rejected input."""

import logging
from dataclasses import replace
from itertools import product

import pytest

from bentray_kernels.compilation.compile_events import Compilation
from bentray_kernels.errors import InvalidInput
from bentray_kernels.tomography import Settings
from bentray_kernels.tomography.result import Progress
from bentray_workers.cluster.job_progress import JobProgress, compilation_on
from bentray_workers.cluster.refusal_log import shorten
from bentray_workers.cluster.task_words import TASK_WORDS, task_in_words
from bentray_workers.files.dataset.counts import Summary, Traces
from bentray_workers.reconstruction.planning import plan
from bentray_workers.rendering.turntable import Turntable
from bentray_workers.rendering.turntable_planning import plan_turntable
from bentray_workers.simulation.request import PhantomScan
from bentray_workers.simulation.simulation_planning import plan_simulation

from ...clock import Clock

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


def test_kernels_are_counted_while_nothing_else_is_reported():
    clock, shown, counts = Clock(), [], [Compilation()]
    progress = JobProgress(shown.append, lambda: counts[-1], clock=clock)
    progress.report(Progress(2, 8, phase="picking"))
    for clock.now, compiled in (
        (1.0, Compilation(1, 40, active=True)),  # of another job, perhaps
        (2.0, Compilation(3, 40, active=True)),
        (2.5, Compilation(4, 40, active=True)),  # too soon after the last look
        (3.0, Compilation(31, 45, active=True)),
        (4.0, Compilation(31, 45, active=True)),
        (5.0, Compilation(45, 45, active=False)),
    ):
        counts.append(compiled)
        progress.look()
    assert shown == [
        Progress(2, 8, phase="picking"),
        Progress(3, 40, phase="compiling"),
        Progress(31, 45, phase="compiling"),
        Progress(2, 8, phase="picking"),
    ]


def test_stages_of_a_task_are_shown_while_it_runs():
    clock, shown, stages = Clock(), [], [Progress(0, 0)]
    progress = JobProgress(shown.append, Compilation, lambda: stages[-1], clock)
    stop = progress.watching(lambda: len(shown) == 2)
    cutting, sampling = Progress(0, 64, phase="cutting"), Progress(1, 6, phase="sampling")
    stopped = []
    for clock.now, stage in ((1.0, cutting), (2.0, sampling)):
        stages.append(stage)
        stopped.append(stop())
    assert shown == [cutting, sampling]
    assert stopped == [False, True]


class Scheduler:
    def __init__(self, *workers):
        self._workers = dict(enumerate(workers))

    def scheduler_info(self, n_workers):
        return {"workers": self._workers}


def test_kernels_of_all_workers_that_compile_are_counted():
    compiling, other = ({"metrics": {"compiling": [done, 20, True]}} for done in (3, 5))
    idle = {"metrics": {"compiling": [40, 40, False]}}
    assert compilation_on(Scheduler(compiling, other, idle, {})) == Compilation(8, 40, active=True)
    assert not compilation_on(Scheduler(idle, {})).active


def refuse():
    raise InvalidInput("iso", 7, "0 to 1")


def fail():
    raise RuntimeError("broken")


@pytest.mark.parametrize(
    ("task", "error", "traced"), [(refuse, InvalidInput, False), (fail, RuntimeError, True)]
)
def test_the_log_of_a_task_that_raises(cluster, caplog, task, error, traced):
    with caplog.at_level(logging.INFO, "distributed.worker"), pytest.raises(error):
        cluster.client.submit(task, pure=False).result()
    (said,) = (record.getMessage() for record in caplog.records if error.__name__ in record.getMessage())
    assert ("\n" in said, "Traceback" in said) == (traced, traced)


@pytest.mark.parametrize("level", [logging.INFO, logging.WARNING])
def test_a_heartbeat_to_a_closed_scheduler_is_no_error(level):
    log = logging.getLogger("distributed.worker.test")
    log.setLevel(level)
    error = (OSError, OSError("Stream is closed"), None)
    said = "Failed to communicate with scheduler during heartbeat."
    record = log.makeRecord(log.name, logging.ERROR, "worker.py", 1, said, (), error)
    assert shorten(record) == (level == logging.INFO)
    assert (record.levelname, record.exc_info) == ("INFO", None)
