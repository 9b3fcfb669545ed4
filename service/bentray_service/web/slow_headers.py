"""Heads of requests come in time and are short, or the connection is closed: nobody is known before."""

from __future__ import annotations

import asyncio
import re

import httptools
from starlette.responses import Response
from uvicorn.protocols.http.httptools_impl import STATUS_LINE, HttpToolsProtocol

from bentray_kernels.errors import InvalidInput

from ..refusals import HeadersTooLarge, MalformedRequest, UnknownMethod
from .errors import METHODS, problem_response

# Within it the whole head of a request must be there.
HEAD_S = 10.0
# Its length, and that of what follows a body in chunks.
LONGEST_HEAD = 32 * 1024
# Requests that a client may send before it has the answer to the first of them.
MOST_PIPELINED = 8
# Of what has come, read at once, bytes: others wait for as long as it is parsed.
READ_BYTES = 64 * 1024
# RFC 9112, section 3; the method is a token of RFC 9110, section 5.6.2.
REQUEST_LINE = re.compile(rb"(?:\r?\n)*([!#$%&'*+.^_`|~0-9A-Za-z-]+) [!-~]+ HTTP/\d\.\d\r?\n")


class HeaderTimeout(HttpToolsProtocol):
    """HTTP/1.1 as Uvicorn speaks it by httptools, with a time and a length within which each head must come.

    What cannot be parsed is refused with a problem. Headers that follow a body are dropped: they came after
    the caller was let in. A wish for another protocol is not heard (RFC 9110, section 7.8).
    """

    _due: asyncio.TimerHandle | None = None
    _in_head = False
    # Of the head that comes, or of what follows a body; and all that was read with it.
    _head_bytes = _read_bytes = 0
    # The head that just came asks for another protocol, so that the parser took no body for it.
    _upgrade = False
    # Nothing that comes is heard any more.
    _deaf = False

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Begin to wait for the first request."""
        if hasattr(transport, "max_size"):
            transport.max_size = READ_BYTES
        super().connection_made(transport)
        self._wait()

    def connection_lost(self, exc: Exception | None) -> None:
        """Wait no longer."""
        if self._due is not None:
            self._due.cancel()
        super().connection_lost(exc)

    def on_response_complete(self) -> None:
        """Begin to wait for the next request."""
        super().on_response_complete()
        self._wait()

    def data_received(self, data: bytes) -> None:
        """Parse what came."""
        if self._deaf or self.transport.is_closing():
            return
        self._unset_keepalive_if_required()
        try:
            self._parse(data)
            if self._in_head:
                # The parser holds a header back until its end; the first of these bytes may be of a body.
                self._read_bytes += len(data)
                _check_length(self._read_bytes - READ_BYTES)
        except httptools.HttpParserError as error:
            self.refuse(self._reason(error, data))
        except InvalidInput as error:
            self.refuse(error)

    def _reason(self, error: httptools.HttpParserError, data: bytes) -> InvalidInput:
        """What is wrong with what came last, which the parser did not take."""
        cause = error.__context__
        if isinstance(cause, InvalidInput):
            return cause
        # The parser reads nothing of a request whose method it does not know. Where others came before it
        # in these data, they are being answered, and nobody is told.
        line = REQUEST_LINE.match(data) if self._in_head else None
        if line is not None and line[1].decode() not in METHODS:
            return _unknown(line[1].decode())
        return _malformed(str(error))

    def _parse(self, data: bytes) -> None:
        while data:
            try:
                self.parser.feed_data(data)
                return
            except httptools.HttpParserUpgrade as upgrade:
                data = data[upgrade.args[0] :]
                if self._upgrade:
                    # As the parser would have taken it without the wish; only then it reads the body.
                    self._upgrade = False
                    self.parser = httptools.HttpRequestParser(self)
                    data = self._plain_head() + data

    def _plain_head(self) -> bytes:
        lines = [b"%s %s HTTP/1.1" % (self.scope["method"].encode(), self.url)]
        for name, value in self.headers:
            if name == b"connection":
                value = b", ".join(
                    word for word in value.split(b",") if word.strip().lower() not in (b"upgrade", b"")
                )
            if name != b"upgrade":
                lines.append(b"%s: %s" % (name, value))
        return b"\r\n".join([*lines, b"", b""])

    def on_message_begin(self) -> None:
        """A head begins."""
        super().on_message_begin()
        self._in_head, self._head_bytes, self._read_bytes = True, 0, 0

    def on_url(self, url: bytes) -> None:
        """A part of the address came."""
        self._count(len(url))
        super().on_url(url)

    def on_header(self, name: bytes, value: bytes) -> None:
        """A header came, or what follows a body."""
        self._count(len(name) + len(value))
        if self._in_head:
            super().on_header(name, value.strip(b" \t"))

    def on_headers_complete(self) -> None:
        """The head is there: begin to answer."""
        self._in_head, self._head_bytes = False, 0
        if self.parser.should_upgrade():
            method = self.parser.get_method().decode("ascii")
            if method == "CONNECT":
                raise _unknown(method)
            self.scope["method"], self._upgrade = method, True
            return
        hosts = sum(name == b"host" for name, _ in self.headers)
        if hosts != 1 and self.parser.get_http_version() == "1.1":
            raise MalformedRequest("Host", f"{hosts} of it", "one, as HTTP/1.1 asks for")
        if len(self.pipeline) >= MOST_PIPELINED:
            accepted = f"at most {MOST_PIPELINED} that wait for an answer"
            raise MalformedRequest("requests", f"more than {MOST_PIPELINED} at once", accepted)
        super().on_headers_complete()

    def on_message_complete(self) -> None:
        """The request is there."""
        if not self._upgrade:
            super().on_message_complete()

    def answering(self) -> bool:
        """Whether a request is being answered."""
        return self.cycle is not None and (not self.cycle.response_complete or bool(self.pipeline))

    def refuse(self, error: InvalidInput) -> None:
        """Tell what is wrong with what came, and close; an answer that is being made is finished first."""
        self._deaf = True
        if self.answering():
            self.cycle.keep_alive = False
            return
        self.transport.write(_written(problem_response(error, None)))
        self.leave()

    def leave(self) -> None:
        """Close the connection once all that was written has gone."""
        self.transport.close()

    def _count(self, more: int) -> None:
        self._head_bytes += more
        _check_length(self._head_bytes)

    def _wait(self) -> None:
        if self._due is not None:
            self._due.cancel()
        self._due = self.loop.call_later(HEAD_S, self._close_if_still_waiting)

    def _close_if_still_waiting(self) -> None:
        if not self.answering() and not self.transport.is_closing():
            self.transport.close()


def _check_length(head: int) -> None:
    if head > LONGEST_HEAD:
        raise HeadersTooLarge("head", f"more than {LONGEST_HEAD} bytes", f"at most {LONGEST_HEAD} bytes")


def _malformed(reason: str) -> MalformedRequest:
    return MalformedRequest("request", f"no HTTP/1.1 ({reason})", "a request as RFC 9112 writes it")


def _unknown(method: str) -> UnknownMethod:
    return UnknownMethod("method", method, ", ".join(METHODS))


def _written(response: Response) -> bytes:
    """An answer as it goes over the line, the last one of its connection."""
    headers = [*response.raw_headers, (b"connection", b"close")]
    lines = b"".join(b"%s: %s\r\n" % one for one in headers)
    return STATUS_LINE[response.status_code] + lines + b"\r\n" + bytes(response.body)
