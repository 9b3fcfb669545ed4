"""Workers that join: each is replaced when it is lost, and all begin again when their scheduler is gone."""

import asyncio
from collections.abc import Callable
from pathlib import Path

import pytest
from distributed import Scheduler
from distributed.security import Security

from bentray_workers.cluster import local_workers
from bentray_workers.cluster.dask_settings import NO_DASHBOARD, ours
from bentray_workers.cluster.local_workers import JoinRequest
from bentray_workers.cluster.resources import OFFERED

PATIENCE_S = 60.0


async def until(so: Callable[[], object]) -> None:
    async with asyncio.timeout(PATIENCE_S):
        while not so():
            await asyncio.sleep(0.05)


@pytest.mark.nightly
def test_a_lost_worker_is_replaced_until_the_scheduler_is_gone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(local_workers, "PRELOADS", [])
    monkeypatch.setattr(local_workers, "CHECK_S", 0.1)
    said: list[str] = []

    async def lose_some() -> None:
        async with Scheduler(host="127.0.0.1", port=0, dashboard_address=NO_DASHBOARD) as scheduler:
            asked = JoinRequest(scheduler.address, 2, OFFERED, None, tmp_path, None, None, Security())
            nannies = [local_workers._nanny(asked, number) for number in range(2)]
            working = asyncio.create_task(local_workers._work(asked, nannies, said.append))
            await until(lambda: said)
            (first, second), before = nannies, list(scheduler.workers.values())
            await first.close()
            await until(lambda: len(scheduler.workers) == 2 and first not in nannies)
            assert nannies[1] is second
            assert len([worker for worker in scheduler.workers.values() if worker in before]) == 1
            assert not working.done()
        await asyncio.wait_for(working, PATIENCE_S)
        await local_workers._close(nannies)

    with ours():
        asyncio.run(lose_some())
    assert said[0].startswith("2 workers joined tcp://127.0.0.1:")
    assert said[1] == "1 of 2 workers are lost; starting others."
