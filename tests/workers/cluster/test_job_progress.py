"""Progress of a job between its tasks: compiled kernels and stages, in the order of injected events."""

from bentray_kernels.compilation.compile_events import Compilation
from bentray_kernels.tomography.result import Progress
from bentray_workers.cluster.job_progress import JobProgress, compilation_on

from ...clock import Clock


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
