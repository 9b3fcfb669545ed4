"""Ends requests in progress when their key, session or membership ends, polling the database."""

import asyncio
import logging
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager

import anyio
from sqlalchemy.exc import SQLAlchemyError
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from ..errors import DatabaseUnavailable, NotAuthenticated
from ..rows.keys import Keys, Sessions
from ..rows.projects import Projects
from ..web.errors import problem_response

log = logging.getLogger("bentray.access")

INTERVAL_SECONDS = 1.0

EVENTS = b"text/event-stream"


class KeyWatch:
    """The requests in progress of each key, session and membership of a project.

    Another process may end them, therefore the database is polled. Most requests end before the first poll.
    """

    def __init__(self, keys: Keys, sessions: Sessions, projects: Projects) -> None:
        self._keys = keys
        self._sessions = sessions
        self._projects = projects
        self._under_way: dict[str, set[Callable[[], None]]] = {}
        self._polling: asyncio.Task[None] | None = None

    @contextmanager
    def during(self, key_id: str, end: Callable[[], None]) -> Iterator[None]:
        """Within the block, call ``end`` once if the key, session or membership ends."""
        self._under_way.setdefault(key_id, set()).add(end)
        if self._polling is None:
            self._polling = asyncio.create_task(self._poll())
        try:
            yield
        finally:
            ends = self._under_way.get(key_id, set())
            ends.discard(end)
            if not ends:
                self._under_way.pop(key_id, None)

    def _ended(self, ids: list[str]) -> list[str]:
        return [*self._keys.ended(ids), *self._sessions.ended(ids), *self._projects.ended(ids)]

    async def _poll(self) -> None:
        # A thread of its own, so that polling does not wait for other work.
        limiter = anyio.CapacityLimiter(1)
        try:
            while True:
                await asyncio.sleep(INTERVAL_SECONDS)
                if not self._under_way:
                    return
                try:
                    ended = await anyio.to_thread.run_sync(
                        self._ended, list(self._under_way), limiter=limiter
                    )
                except (SQLAlchemyError, DatabaseUnavailable) as error:
                    log.warning("ended keys and sessions could not be read: %s", error)
                    continue
                for key_id in ended:
                    for end in self._under_way.pop(key_id, set()):
                        end()
        finally:
            self._polling = None


async def answer_while_valid(
    app: ASGIApp, scope: Scope, receive: Receive, send: Send, watch: KeyWatch, ids: Sequence[str]
) -> None:
    """Answer a request until its key, session or membership of a project ends; ``ids`` are theirs.

    Before the response has started, it becomes 401. An event stream ends; the connection of any other
    response is aborted, so that the client does not take a part of a file for the whole.
    """
    cancelling = anyio.CancelScope()
    ended = begun = events = replaced = complete = False
    refusal = NotAuthenticated(
        "Authorization", "a key, session or membership that ended during the request", "a valid one"
    )

    def end() -> None:
        nonlocal ended
        ended = True
        if begun:
            cancelling.cancel()

    async def receive_while_valid() -> Message:
        message = await receive()
        if ended and not begun:
            raise refusal
        return message

    async def send_while_valid(message: Message) -> None:
        nonlocal begun, events, replaced, complete
        if message["type"] == "http.response.start":
            if ended:
                replaced = True
                await problem_response(refusal, scope["path"])(scope, receive, send)
                cancelling.cancel()
                return
            begun = True
            types = [value for name, value in message["headers"] if name.lower() == b"content-type"]
            events = any(value.startswith(EVENTS) for value in types)
        elif not replaced:
            complete = not message.get("more_body", False)
        if not replaced:
            await send(message)

    with ExitStack() as watched:
        for key_id in ids:
            watched.enter_context(watch.during(key_id, end))
        watched.enter_context(cancelling)
        await app(scope, receive_while_valid, send_while_valid)
    if begun and events and not complete:
        await send({"type": "http.response.body", "body": b"", "more_body": False})
