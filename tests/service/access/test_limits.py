"""Every limit of a tenant, used by its projects in turn: they share it, and other tenants have theirs."""

import asyncio
import itertools
import math
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any

import pytest

from bentray_service.access.caller import Caller
from bentray_service.access.sign_in import SignIn
from bentray_service.errors import QueueFull, QuotaExceeded, RateLimited, TooManyStreams
from bentray_service.files.data_folder import Files
from bentray_service.ingest.fair_queue import FairQueue
from bentray_service.ingest.upload_ingest import UploadLimits
from bentray_service.jobs.feed import OF_ACCOUNT, EventFeed
from bentray_service.jobs.runner import Runner
from bentray_service.picture_queue import MAX_PER_ACCOUNT
from bentray_service.pictures import Pictures
from bentray_service.rows import deliveries as messages
from bentray_service.rows.accounts import Accounts
from bentray_service.rows.database import Database, open_database
from bentray_service.rows.deliveries import Deliveries
from bentray_service.rows.ids import Tenant, new_id
from bentray_service.rows.job_queue import Queue
from bentray_service.rows.jobs import Jobs, NewJob, Submission
from bentray_service.rows.projects import Projects
from bentray_service.rows.tables import DatasetRow
from bentray_service.rows.uploads import MAX_INCOMPLETE, Uploads
from bentray_service.rows.usage import reserve
from bentray_service.settings import ServiceSettings
from bentray_workers.rendering.picture_cost import Cost
from bentray_workers.rendering.tiles import PictureTasks

from ..conftest import FakeCluster

LAB, OTHER = Tenant("lab"), Tenant("other")
MEMBER = "user:x"
REFUSED = (RateLimited, TooManyStreams, QueueFull, QuotaExceeded)
# Raises one of ``REFUSED`` beyond a limit; what it uses is released at the end of the stack.
Use = Callable[[Tenant], object]


class World:
    """A database with two projects of one tenant."""

    def __init__(self, database: Database, stack: ExitStack) -> None:
        self.database, self.stack, self.accounts = database, stack, Accounts(database)
        made = Projects(database)
        self.owners = [LAB, *(Tenant(made.add(LAB, name, MEMBER).id) for name in ("One", "Two"))]

    def sign_in(self) -> SignIn:
        settings = ServiceSettings(requests_per_minute=7, renders_per_minute=5)
        return SignIn(settings, self.database, self.accounts)

    def caller(self, tenant: Tenant) -> Caller:
        return Caller(tenant, "key", "0", frozenset(("read", "write")))


@pytest.fixture
def world(tmp_path) -> Iterator[World]:
    database = open_database(f"sqlite:///{tmp_path / 'db.sqlite'}")
    with ExitStack() as stack:
        stack.callback(database.close)
        yield World(database, stack)


def requests(world: World) -> tuple[int, Use]:
    gate = world.sign_in()
    return 7, lambda tenant: gate.check(world.caller(tenant), "GET", "/v1/jobs")


def renders(world: World) -> tuple[int, Use]:
    gate = world.sign_in()
    return 5, lambda tenant: gate.check_render(world.caller(tenant))


def streams(world: World) -> tuple[int, Use]:
    async def polls(_feed: EventFeed) -> None: ...

    loop = asyncio.new_event_loop()
    feed = EventFeed(Jobs(world.database), world.accounts, lambda: False)

    def watch(tenant: Tenant) -> None:
        async def begin() -> None:
            # One of a job, one of all jobs.
            one = feed.watch(tenant, "job-1") if len(feed._watched) % 2 else feed.watch_tenant(tenant)
            world.stack.enter_context(one)

        loop.run_until_complete(begin())

    def end() -> None:
        for task in asyncio.all_tasks(loop):
            task.cancel()
            with suppress(asyncio.CancelledError):
                loop.run_until_complete(task)
        loop.close()

    world.stack.callback(end)
    return OF_ACCOUNT, watch


def uploads_in_progress(world: World) -> tuple[int, Use]:
    limits = UploadLimits(world.accounts, of_account=3)
    return 3, lambda tenant: world.stack.enter_context(limits(tenant))


def uploads_a_minute(world: World) -> tuple[int, Use]:
    return 4, UploadLimits(world.accounts, begun_per_minute=4).check_begin


def incomplete_uploads(world: World) -> tuple[int, Use]:
    rows = Uploads(world.database)
    return MAX_INCOMPLETE, lambda tenant: rows.add(tenant, "dataset", 1, {}, "", 60.0, 10**6)


def stored_bytes(world: World) -> tuple[int, Use]:
    number = itertools.count()

    def store(tenant: Tenant) -> None:
        with world.database.write() as connection:
            reserve(connection, tenant, f"ds-{next(number)}", 10, 60)

    return 6, store


def queued_jobs(world: World) -> tuple[int, Use]:
    rows = Jobs(world.database)
    return 5, lambda tenant: rows.add(tenant, NewJob("simulation", {}), Submission(most_queued=5))


def running_jobs(world: World, at_once: int = 2) -> tuple[int, Use]:
    """Up to four run, two of them of any tenant: the projects of one do not count as further tenants."""
    settings = ServiceSettings(jobs_at_once=at_once, tenants_at_once=4)
    runner = Runner(Queue(world.database), world.accounts, None, None, settings)  # type: ignore[arg-type]
    rows, running = Jobs(world.database), []

    def run(tenant: Tenant) -> None:
        job = rows.add(tenant, NewJob("simulation", {}))
        count = len(running)
        if count >= runner._most or runner.queue.claim(idle_only=count >= runner._at_once) is None:
            rows.request_cancel(tenant, job.id)
            raise RateLimited("jobs", "waits", "later", 1.0)
        running.append(job.id)

    return runner._at_once, run


def last_running_job(world: World) -> tuple[int, Use]:
    """Where one tenant may have all four that run, one is kept for others."""
    return 3, running_jobs(world, at_once=4)[1]


def pictures(world: World) -> tuple[int, Use]:
    made, loop = Pictures(FakeCluster(), world.accounts, Files(Path("unused"))), asyncio.new_event_loop()
    # The list of workers is fresh, so that nothing is waited for before the admission.
    made._queue._asked = math.inf
    held: list[asyncio.Task[Any]] = []

    async def file_that_never_comes(_work: object) -> None:
        await asyncio.sleep(60.0)

    async def run(tenant: Tenant) -> None:
        scan = DatasetRow(id=new_id("dataset"), tenant=tenant)
        tasks = made._made(scan, Cost(0.0, 0), "image", lambda path: PictureTasks([], None))
        task = asyncio.ensure_future(tasks)
        await asyncio.sleep(0.0)
        if task.done():
            await task
        held.append(task)

    async def end() -> None:
        for task in held:
            task.cancel()
        await asyncio.gather(*held, return_exceptions=True)

    made._fetched = file_that_never_comes  # type: ignore[method-assign,assignment]
    world.stack.callback(made.stop)
    world.stack.callback(loop.close)
    world.stack.callback(lambda: loop.run_until_complete(end()))
    return MAX_PER_ACCOUNT, lambda tenant: loop.run_until_complete(run(tenant))


def readers_of_uploads(world: World) -> tuple[int, Use]:
    queue, leave = FairQueue(3, world.accounts), threading.Event()
    queue.start()
    world.stack.callback(queue.stop)
    world.stack.callback(leave.set)

    def read(tenant: Tenant) -> None:
        begun = threading.Event()
        queue.submit(tenant, lambda: (begun.set(), leave.wait()))
        if not begun.wait(0.2):
            raise RateLimited("uploads", "waits", "later", 1.0)

    return 2, read


def messages_under_way(world: World) -> tuple[int, Use]:
    rows, queue, sent = Jobs(world.database), Queue(world.database), Deliveries(world.database)

    def send(tenant: Tenant) -> None:
        job = rows.add(tenant, NewJob("simulation", {}), Submission(webhook="https://example.org/"))
        queue.claim()
        queue.fail(job.id, {"detail": "why"})
        if sent.claim() is None:
            raise RateLimited("messages", "waits", "later", 1.0)

    return messages.OF_ACCOUNT, send


LIMITS = (
    requests,
    renders,
    streams,
    uploads_in_progress,
    uploads_a_minute,
    incomplete_uploads,
    stored_bytes,
    queued_jobs,
    running_jobs,
    last_running_job,
    pictures,
    readers_of_uploads,
    messages_under_way,
)


@pytest.mark.parametrize("limit", LIMITS, ids=lambda limit: limit.__name__)
def test_projects_share_the_limit_of_their_tenant(world: World, limit) -> None:
    most, use = limit(world)
    accepted = 0
    for tenant in itertools.islice(itertools.cycle(world.owners), 3 * most):
        try:
            use(tenant)
        except REFUSED:
            break
        accepted += 1
    assert accepted == most
    for tenant in world.owners:
        with pytest.raises(REFUSED):
            use(tenant)
    # What is left of a pool for all is for others.
    use(OTHER)


def test_the_account_of_a_project_is_read_once(world: World, monkeypatch) -> None:
    assert [world.accounts.of(one) for one in (*world.owners, OTHER)] == ["lab", "lab", "lab", "other"]
    monkeypatch.setattr(world.database, "read", None)
    assert world.accounts.of(world.owners[2]) == "lab"
