"""Slow request bodies: the reader gets an error, and no other request is affected."""

import asyncio

import pytest

from bentray_service.errors import BodyTimeout
from bentray_service.web.slow_bodies import MIN_BYTES, SlowBodies

HTTP = {"type": "http"}
SECONDS = 0.5


def run(chunks, *, every, seconds=SECONDS, scope=HTTP):
    """The sizes of what an application reads of chunks that come so often, up to the end of the body."""
    got = []

    async def app(scope, receive, send):
        while True:
            message = await receive()
            got.append(len(message["body"]))
            if not message["more_body"]:
                return

    async def receive():
        await asyncio.sleep(every)
        body = chunks.pop(0)
        return {"type": "http.request", "body": body, "more_body": bool(chunks)}

    asyncio.run(SlowBodies(app, seconds)(scope, receive, None))
    return got


def test_a_body_that_comes_is_read():
    assert run([b"x"] * 5, every=0.0) == [1] * 5


def test_a_body_that_drips_is_broken_off():
    with pytest.raises(BodyTimeout, match=f"at least {MIN_BYTES} bytes in 0.5 s"):
        run([b"x"] * 10_000, every=0.005)


def test_a_body_that_stops_is_broken_off():
    with pytest.raises(BodyTimeout):
        run([b"x", b"y"], every=60.0)


def test_enough_in_each_time_is_enough():
    # Longer in all than the time for one part of it, at any speed of this machine.
    assert len(run([bytes(MIN_BYTES)] * 220, every=0.01, seconds=2.0)) == 220


def test_client_waiting_after_the_body_is_not_timed_out():
    async def app(scope, receive, send):
        await receive()
        assert (await receive())["type"] == "http.disconnect"

    messages = [{"type": "http.request"}, {"type": "http.disconnect"}]

    async def receive():
        await asyncio.sleep(0.0 if len(messages) == 2 else 0.3)
        return messages.pop(0)

    asyncio.run(SlowBodies(app, 0.1)(HTTP, receive, None))
    assert not messages


def test_other_connections_pass():
    async def app(scope, receive, send):
        assert receive == "receive"

    asyncio.run(SlowBodies(app, 0.1)({"type": "lifespan"}, "receive", "send"))
