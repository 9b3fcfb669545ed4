"""Time and size limits for request headers, before authentication."""

from __future__ import annotations

import asyncio
import re

import httptools
from starlette.responses import Response
from uvicorn.protocols.http.httptools_impl import STATUS_LINE, HttpToolsProtocol

from bentray_kernels.errors import InvalidInput

from ..errors import HeadersTooLarge, MalformedRequest, UnknownMethod
from .errors import METHODS, problem_response

# Time limit for all headers of a request, s.
HEAD_S = 10.0
# Maximum length of the headers, and of trailers.
LONGEST_HEAD = 32 * 1024
# Maximum number of pipelined requests.
MAX_PIPELINED = 8
# Bytes read at once; other connections wait while they are parsed.
READ_BYTES = 64 * 1024
# RFC 9112, section 3; the method is a token of RFC 9110, section 5.6.2.
REQUEST_LINE = re.compile(rb"(?:\r?\n)*([!#$%&'*+.^_`|~0-9A-Za-z-]+) [!-~]+ HTTP/\d\.\d\r?\n")


class HeaderTimeout(HttpToolsProtocol):
    """The HTTP/1.1 protocol of Uvicorn with httptools, with limits for request headers.

    Malformed requests are rejected with a problem. Trailers are ignored, since they follow the
    authentication, and so are upgrade requests (RFC 9110, section 7.8).
    """

    _due: asyncio.TimerHandle | None = None
    _in_head = False
    # Length of the current headers or trailers, and of all data read with them.
    _head_bytes = _read_bytes = 0
    # Whether the headers request an upgrade, so that the parser ignores the body.
    _upgrade = False
    # Whether further data is ignored.
    _ignoring = False

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Start the time limit of the first request."""
        if hasattr(transport, "max_size"):
            transport.max_size = READ_BYTES
        super().connection_made(transport)
        self._wait()

    def connection_lost(self, exc: Exception | None) -> None:
        """Stop the time limit."""
        if self._due is not None:
            self._due.cancel()
        super().connection_lost(exc)

    def on_response_complete(self) -> None:
        """Start the time limit of the next request."""
        super().on_response_complete()
        self._wait()

    def data_received(self, data: bytes) -> None:
        """Parse received data."""
        if self._ignoring or self.transport.is_closing():
            return
        self._unset_keepalive_if_required()
        try:
            self._parse(data)
            if self._in_head:
                # The parser reports a header after its end; the first bytes may belong to a body.
                self._read_bytes += len(data)
                _check_length(self._read_bytes - READ_BYTES)
        except httptools.HttpParserError as error:
            self.refuse(self._reason(error, data))
        except InvalidInput as error:
            self.refuse(error)

    def _reason(self, error: httptools.HttpParserError, data: bytes) -> InvalidInput:
        """The reason why the last data is invalid."""
        cause = error.__context__
        if isinstance(cause, InvalidInput):
            return cause
        # The parser stops at an unknown method. Earlier requests in the same data are still
        # answered, without this error.
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
                    # Parse again without the upgrade, so that the body is read.
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
        """Headers begin."""
        super().on_message_begin()
        self._in_head, self._head_bytes, self._read_bytes = True, 0, 0

    def on_url(self, url: bytes) -> None:
        """A part of the address was received."""
        self._count(len(url))
        super().on_url(url)

    def on_header(self, name: bytes, value: bytes) -> None:
        """A header or trailer was received."""
        self._count(len(name) + len(value))
        if self._in_head:
            super().on_header(name, value.strip(b" \t"))

    def on_headers_complete(self) -> None:
        """All headers were received."""
        self._in_head, self._head_bytes = False, 0
        if self.parser.should_upgrade():
            method = self.parser.get_method().decode("ascii")
            if method == "CONNECT":
                raise _unknown(method)
            self.scope["method"], self._upgrade = method, True
            return
        hosts = sum(name == b"host" for name, _ in self.headers)
        if hosts != 1 and self.parser.get_http_version() == "1.1":
            raise MalformedRequest("Host", f"{hosts} Host headers", "exactly one in HTTP/1.1")
        if len(self.pipeline) >= MAX_PIPELINED:
            accepted = f"at most {MAX_PIPELINED} pipelined requests"
            raise MalformedRequest("requests", f"more than {MAX_PIPELINED} at once", accepted)
        super().on_headers_complete()

    def on_message_complete(self) -> None:
        """The request was received completely."""
        if not self._upgrade:
            super().on_message_complete()

    def in_progress(self) -> bool:
        """Whether a request is in progress."""
        return self.cycle is not None and (not self.cycle.response_complete or bool(self.pipeline))

    def refuse(self, error: InvalidInput) -> None:
        """Send an error and close; a response in progress is completed first."""
        self._ignoring = True
        if self.in_progress():
            self.cycle.keep_alive = False
            return
        self.transport.write(_written(problem_response(error, None)))
        self.leave()

    def leave(self) -> None:
        """Close the connection after all data was sent."""
        self.transport.close()

    def _count(self, more: int) -> None:
        self._head_bytes += more
        _check_length(self._head_bytes)

    def _wait(self) -> None:
        if self._due is not None:
            self._due.cancel()
        self._due = self.loop.call_later(HEAD_S, self._close_if_still_waiting)

    def _close_if_still_waiting(self) -> None:
        if not self.in_progress() and not self.transport.is_closing():
            self.transport.close()


def _check_length(head: int) -> None:
    if head > LONGEST_HEAD:
        raise HeadersTooLarge("headers", f"more than {LONGEST_HEAD} bytes", f"at most {LONGEST_HEAD} bytes")


def _malformed(reason: str) -> MalformedRequest:
    return MalformedRequest("request", f"malformed HTTP/1.1 ({reason})", "a request as in RFC 9112")


def _unknown(method: str) -> UnknownMethod:
    return UnknownMethod("method", method, ", ".join(METHODS))


def _written(response: Response) -> bytes:
    """The bytes of a response that closes its connection."""
    headers = [*response.raw_headers, (b"connection", b"close")]
    lines = b"".join(b"%s: %s\r\n" % one for one in headers)
    return STATUS_LINE[response.status_code] + lines + b"\r\n" + bytes(response.body)
