"""Time limit for slow request bodies."""

from __future__ import annotations

import asyncio

from starlette.types import ASGIApp, Message, Receive, Scope, Send

from ..errors import BodyTimeout

# Bytes of the body that must arrive within the time limit.
MIN_BYTES = 64 * 1024


class SlowBodies:
    """ASGI middleware: ``MIN_BYTES`` or the end of each body must arrive in every period of ``seconds``.

    Otherwise reading the body raises :class:`BodyTimeout`.
    """

    def __init__(self, app: ASGIApp, seconds: float) -> None:
        self.app = app
        self._seconds = seconds

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        clock = asyncio.get_running_loop().time
        due, came, ended = clock() + self._seconds, 0, False

        async def receive_in_time() -> Message:
            nonlocal due, came, ended
            if ended:
                # Only the disconnection is awaited now.
                return await receive()
            try:
                async with asyncio.timeout_at(due):
                    message = await receive()
            except TimeoutError:
                found = f"{came} bytes in {self._seconds:g} s"
                accepted = f"at least {MIN_BYTES} bytes in {self._seconds:g} s (BENTRAY_UPLOAD_PATIENCE_S)"
                raise BodyTimeout("body", found, accepted) from None
            came += len(message.get("body", b""))
            ended = not message.get("more_body", False)
            if came >= MIN_BYTES:
                due, came = clock() + self._seconds, 0
            return message

        await self.app(scope, receive_in_time, send)
