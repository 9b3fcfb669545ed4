"""Cancellation: long kernels end when their task is abandoned, and never outside a worker."""

import os
import threading
import time

import pytest
from distributed import Client, LocalCluster

from bentray_kernels.phantoms import ONE_HOLE, sampled
from bentray_kernels.refraction import Layers
from bentray_workers.cluster.background import NICENESS, in_background
from bentray_workers.cluster.dask_settings import NO_DASHBOARD
from bentray_workers.cluster.task_cancellation import TaskCancelled, cancellation_check
from bentray_workers.files.volume import Volume
from bentray_workers.rendering import scene_cache
from bentray_workers.rendering.refraction_view import RefractionView

from ...waiting import wait_until

BEGUN, ENDED = threading.Event(), []
PATIENCE_S = 60.0


def long_task():
    check, until = cancellation_check(), time.monotonic() + PATIENCE_S
    BEGUN.set()
    try:
        while time.monotonic() < until:
            check()
            time.sleep(0.01)
    except TaskCancelled:
        ENDED.append("early")
        raise
    ENDED.append("late")


@pytest.mark.parametrize("background", [False, True])
def test_a_task_that_is_released_ends(background):
    BEGUN.clear()
    ENDED.clear()
    # Without our preload, which compiles every kernel first.
    with (
        LocalCluster(
            n_workers=1,
            processes=False,
            dashboard_address=NO_DASHBOARD,
            scheduler_kwargs={"dashboard": False},
        ) as cluster,
        Client(cluster, set_as_default=False) as client,
    ):
        future = client.submit(*([in_background] if background else []), long_task, pure=False)
        assert BEGUN.wait(PATIENCE_S)
        assert not ENDED
        future.release()
        wait_until(lambda: ENDED)
    assert ENDED == ["early"]


def test_background_threads_alone_are_lowered():
    def seen():
        return os.getpriority(os.PRIO_PROCESS, threading.get_native_id())

    usual = seen()
    # Whichever thread it is, it is lowered once.
    for _ in range(20):
        assert in_background(seen) == min(19, usual + NICENESS)
    with pytest.raises(ZeroDivisionError):
        in_background(lambda: 1 / 0)
    assert seen() == usual


def test_outside_of_a_worker_nothing_is_abandoned():
    cancellation_check()()


def test_abandoned_scene_is_not_built(monkeypatch):
    def nobody():
        def check():
            raise TaskCancelled("task")

        return check

    monkeypatch.setattr(scene_cache, "cancellation_check", nobody)
    filtered = scene_cache.filter_volume(
        Volume.from_values(sampled(ONE_HOLE, 12), (1e-3,) * 3), RefractionView()
    )
    with pytest.raises(TaskCancelled):
        scene_cache.build_scene(filtered, Layers((0.5,), (1.0, 1.5)))
