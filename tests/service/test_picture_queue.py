"""The picture queue: fairness between tenants, cost, memory, and rejected requests."""

import asyncio
from contextlib import suppress

import pytest

from bentray_service import picture_queue
from bentray_service.errors import RateLimited
from bentray_service.picture_queue import LATEST_S, MAX_IN_TOTAL, MAX_PER_ACCOUNT, PictureQueue
from bentray_service.rows.ids import Tenant
from bentray_workers.cluster.capacities import WorkerCapacity

A, B, C = (Tenant(name) for name in "abc")


class Run:
    """A queue over some workers, and who had a worker when."""

    def __init__(self, *memory):
        self.offers = {f"w{k}": WorkerCapacity(size, ("render",)) for k, size in enumerate(memory or (0,))}
        self.queue = PictureQueue(self.workers)
        self.order = []
        self.gates = {}

    async def workers(self):
        return self.offers

    async def task(self, tenant, name, *, least=0, long=False):
        self.gates[name] = asyncio.Event()
        fits = lambda offer: offer.memory_bytes >= least  # noqa: E731 - as short as a call of it
        async with self.queue.place(tenant, fits, long=long) as address:
            self.order.append((name, address))
            await self.gates[name].wait()

    def names(self):
        return [name for name, _ in self.order]


async def settle():
    for _ in range(10):
        await asyncio.sleep(0)


def test_tenants_alternate_in_the_picture_queue():
    async def go():
        run = Run()
        await run.queue.workers()
        many = [asyncio.create_task(run.task(A, f"a{k}")) for k in range(20)]
        await settle()
        one = asyncio.create_task(run.task(B, "b"))
        await settle()
        assert run.names() == ["a0"]
        run.gates["a0"].set()
        await settle()
        assert run.names() == ["a0", "b"]
        run.gates["b"].set()
        await settle()
        assert run.names() == ["a0", "b", "a1"]
        for task in (*many, one):
            task.cancel()
        await asyncio.gather(*many, one, return_exceptions=True)
        await run.queue.close()
        # All of them gone, nothing is held.
        last = asyncio.create_task(run.task(C, "c"))
        await settle()
        assert run.names()[-1] == "c"
        run.gates["c"].set()
        await last

    asyncio.run(go())


def test_tenants_take_turns():
    async def go():
        run = Run()
        await run.queue.workers()
        tasks = [asyncio.create_task(run.task(t, f"{t}{k}")) for t in (A, B, C) for k in range(3)]
        await settle()
        for _ in range(9):
            run.gates[run.names()[-1]].set()
            await settle()
        await asyncio.gather(*tasks)
        assert run.names() == ["a0", "b0", "c0", "a1", "b1", "c1", "a2", "b2", "c2"]

    asyncio.run(go())


def test_long_tasks_leave_a_worker_free():
    async def go():
        run = Run(0, 0, 0)
        await run.queue.workers()
        long = [asyncio.create_task(run.task(A, f"a{k}", long=True)) for k in range(3)]
        await settle()
        assert run.names() == ["a0", "a1"]
        short = asyncio.create_task(run.task(B, "b"))
        await settle()
        assert run.names() == ["a0", "a1", "b"]
        for name in ("b", "a0", "a1"):
            run.gates[name].set()
        await settle()
        run.gates["a2"].set()
        await asyncio.gather(*long, short)
        await run.queue.close()

    asyncio.run(go())


def test_a_task_waits_for_a_worker_that_can_hold_it(monkeypatch):
    monkeypatch.setattr(picture_queue, "FRESH_S", 0.01)

    async def go():
        run = Run(10, 100)
        await run.queue.workers()
        tasks = [asyncio.create_task(run.task(A, f"a{k}", least=50)) for k in range(2)]
        await settle()
        assert run.order == [("a0", "w1")]
        # The next one has joined.
        run.offers = {**run.offers, "w2": WorkerCapacity(100, ("render",))}
        async with asyncio.timeout(10):
            while len(run.order) < 2:
                await asyncio.sleep(0.01)
        assert run.order[1] == ("a1", "w2")
        for gate in run.gates.values():
            gate.set()
        await asyncio.gather(*tasks)
        await run.queue.close()

    asyncio.run(go())


def test_disconnected_clients_free_their_place():
    async def go():
        run = Run()
        await run.queue.workers()
        tasks = [asyncio.create_task(run.task(A, f"a{k}")) for k in range(3)]
        await settle()
        for gone in (tasks[1], tasks[0]):
            gone.cancel()
            with suppress(asyncio.CancelledError):
                await gone
        await settle()
        assert run.names() == ["a0", "a2"]
        run.gates["a2"].set()
        await tasks[2]
        await run.queue.close()

    asyncio.run(go())


def test_late_pictures_are_rejected_with_retry_after():
    async def go():
        run = Run(0, 0)
        await run.queue.workers()
        async with run.queue.admitted(A, 100.0), run.queue.admitted(A, 15.0):
            with pytest.raises(
                RateLimited, match=r"pictures: found 2 images of this tenant in progress"
            ) as refused:
                async with run.queue.admitted(A, 25.0):
                    raise AssertionError
            assert refused.value.wait_s == pytest.approx((100.0 + 15.0 + 25.0) / 2 - LATEST_S)
            # Another tenant takes turns with it and is served within twice its own time.
            async with run.queue.admitted(B, 25.0):
                pass
        async with run.queue.admitted(A, 1000.0):
            """Alone, whatever takes long is taken; what takes too long is refused by its cost."""

    asyncio.run(go())


def test_the_number_of_pictures_is_bounded():
    async def go():
        run = Run()
        held = [run.queue.admitted(A, 0.0) for _ in range(MAX_PER_ACCOUNT)]
        for one in held:
            await one.__aenter__()
        with pytest.raises(RateLimited, match=f"fewer than {MAX_PER_ACCOUNT} per tenant"):
            await run.queue.admitted(A, 0.0).__aenter__()
        others = [run.queue.admitted(Tenant(f"t{k}"), 0.0) for k in range(MAX_IN_TOTAL - MAX_PER_ACCOUNT)]
        for one in others:
            await one.__aenter__()
        with pytest.raises(RateLimited):
            await run.queue.admitted(B, 0.0).__aenter__()
        for one in (*held, *others):
            await one.__aexit__(None, None, None)
        async with run.queue.admitted(A, 0.0):
            """They were given back."""

    asyncio.run(go())


def test_the_time_left_comes_from_measured_times_of_the_same_kind(monkeypatch):
    clock = [100.0]
    monkeypatch.setattr(picture_queue, "monotonic", lambda: clock[0])

    async def go():
        queue = Run(0, 0).queue
        await queue.workers()

        async def drawn(kind, seconds, took):
            async with queue.admitted(A, seconds, kind) as picture:
                picture.begun = clock[0]
                clock[0] += took

        # Too quick for anyone to wait.
        await drawn("glass", 2.0, 0.1)
        async with queue.admitted(A, 4.0, "glass"):
            assert queue.left_s(A) is None
        await drawn("glass", 2.0, 3.0)
        assert queue.left_s(A) is None
        async with queue.admitted(A, 4.0, "glass") as picture, queue.admitted(B, 40.0, "glass"):
            # It waits for its own 6 s and as many of the other account, on two workers.
            assert queue.left_s(A) == pytest.approx(6.0)
            picture.begun = clock[0]
            clock[0] += 2.0
            assert queue.left_s(A) == pytest.approx(4.0)
            assert queue.left_s(B) == pytest.approx(60.0)
            async with queue.admitted(C, 1.0, "clay"):
                assert queue.left_s(A) is None
        clock[0] += 100.0
        assert queue.left_s(A) is None

    asyncio.run(go())
