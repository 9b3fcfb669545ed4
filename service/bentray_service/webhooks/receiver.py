"""Addresses of webhooks: which are permitted, and one POST to such an address.

A service that calls addresses of its clients must not reach what only it can reach. Therefore a host name is
resolved once, its addresses are checked, and the connection is made to the checked address; redirects are not
followed. Proxies of the environment are not used: a proxy resolves the name again, perhaps differently.
"""

from __future__ import annotations

import http.client
import ipaddress
import logging
import socket
import ssl
import threading
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import Any, NamedTuple
from urllib.parse import SplitResult, urlsplit

from bentray_kernels.errors import InvalidInput

from ..web.addresses import Network, within
from ..web.outbound import certificates, proxy_variable

log = logging.getLogger("bentray.webhooks")

LONGEST_URL = 2000
# Time limits of the connection, and of the whole exchange, s.
CONNECT_S = 5.0
EXCHANGE_S = 15.0
ACCEPTED = "an https address on the public internet, without user and fragment"

# IPv6 networks whose addresses contain an IPv4 address, and the position of its first bit.
EMBEDDING = ((ipaddress.ip_network("64:ff9b::/96"), 0), (ipaddress.ip_network("2002::/16"), 80))


class Outcome(NamedTuple):
    """The outcome of an attempt.

    Attributes:
        status: of the response; None without a response.
        error: why it was not accepted; empty if it was.
        seconds: of the exchange.
    """

    status: int | None
    error: str
    seconds: float


def check_url(url: str, permitted: Sequence[Network]) -> SplitResult:
    """Check the form of an address; a host name is not resolved.

    Args:
        url: the address.
        permitted: networks beside the public addresses.

    Raises:
        InvalidInput: naming ``webhook``.
    """
    shown = repr(url[:100])
    try:
        parts = urlsplit(url)
        port = parts.port
    except ValueError:
        raise InvalidInput("webhook", shown, ACCEPTED) from None
    host = parts.hostname or ""
    plain = url.isascii() and url.isprintable() and " " not in url and len(url) <= LONGEST_URL
    if not (plain and host and parts.scheme in ("http", "https") and port != 0):
        raise InvalidInput("webhook", shown, f"{ACCEPTED}, at most {LONGEST_URL} characters")
    if parts.username is not None or parts.fragment:
        raise InvalidInput("webhook", "an address with user or fragment", ACCEPTED)
    if parts.scheme == "http" and not permitted:
        raise InvalidInput("webhook", shown, f"{ACCEPTED} (http only within BENTRAY_WEBHOOK_NETWORKS)")
    if _is_address(host) and not _is_permitted(host, parts.scheme, permitted):
        raise InvalidInput("webhook", shown, f"{ACCEPTED}, or within BENTRAY_WEBHOOK_NETWORKS")
    return parts


def _is_address(host: str) -> bool:
    try:
        ipaddress.ip_address(host)
    except ValueError:
        return False
    return True


def post(url: str, headers: Mapping[str, str], body: bytes, permitted: Sequence[Network]) -> Outcome:
    """Send a message; a status of 200 to 299 accepts it."""
    begun = time.monotonic()
    status, error = None, ""
    try:
        parts = check_url(url, permitted)
        status = _exchange(parts, headers, body, permitted)
        if 300 <= status < 400:
            error = "redirects are not followed"
        elif not 200 <= status < 300:
            error = "not accepted by the receiver"
    except InvalidInput as refused:
        error = f"found {refused.value}; accepted: {refused.accepted}"
        if refused.field != "webhook":
            # The path of a file of certificates is for the operator alone.
            log.warning("no webhook can be sent with TLS: %s", refused)
            error = f"no answer: this service cannot use its {refused.field}"
    except TimeoutError:
        error = f"no answer within {EXCHANGE_S:g} s"
    except ssl.SSLCertVerificationError as failed:
        error = f"the certificate is not valid: {failed.verify_message}"
    except (OSError, http.client.HTTPException) as failed:
        expired = time.monotonic() - begun >= EXCHANGE_S
        reason = getattr(failed, "strerror", None) or type(failed).__name__
        error = f"no answer within {EXCHANGE_S:g} s" if expired else f"no answer: {reason}"
        if variable := proxy_variable(urlsplit(url).scheme):
            error += f" (webhooks do not use {variable})"
    return Outcome(status, error, round(time.monotonic() - begun, 3))


def _exchange(
    parts: SplitResult, headers: Mapping[str, str], body: bytes, permitted: Sequence[Network]
) -> int:
    """Send a request to a checked address; returns the status of the response, whose body is not read."""
    host = parts.hostname or ""
    connection = _Pinned(parts, *_permitted_address(host, parts, permitted))
    # A receiver that sends one byte now and then would never exceed the time limit of a single operation.
    end = threading.Timer(EXCHANGE_S, connection.abort)
    end.daemon = True
    end.start()
    try:
        path = parts.path or "/"
        target = f"{path}?{parts.query}" if parts.query else path
        connection.request("POST", target, body, {**headers, "Connection": "close"})
        return connection.getresponse().status
    finally:
        end.cancel()
        connection.close()


def _permitted_address(
    host: str, parts: SplitResult, permitted: Sequence[Network]
) -> tuple[socket.AddressFamily, Any]:
    """The first permitted address of a host, as the functions of sockets take it."""
    port = parts.port or (443 if parts.scheme == "https" else 80)
    try:
        found = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)
    except (OSError, UnicodeError):
        raise InvalidInput("webhook", "a host name that is not known", ACCEPTED) from None
    for family, _, _, _, address in found:
        text = str(address[0])
        # A zone belongs to an address of the local link only.
        if "%" not in text and _is_permitted(text, parts.scheme, permitted):
            return family, address
    # The addresses themselves are not shown: names of the inner network are not for tenants.
    raise InvalidInput("webhook", "a host without a permitted address", ACCEPTED)


def _is_permitted(address: str, scheme: str, permitted: Sequence[Network]) -> bool:
    """Whether an address may be called: public with TLS, or within a permitted network."""
    if within(address, tuple(permitted)):
        return True
    parsed = ipaddress.ip_address(address)
    if isinstance(parsed, ipaddress.IPv6Address):
        inner = [parsed.ipv4_mapped] if parsed.ipv4_mapped is not None else []
        inner += [
            ipaddress.IPv4Address((int(parsed) >> shift) & 0xFFFFFFFF)
            for network, shift in EMBEDDING
            if parsed in network
        ]
        if inner:
            return all(_is_permitted(str(one), scheme, permitted) for one in inner)
        # Only what is assigned as unicast to the public; Python counts some reserved networks as global.
        if parsed not in ipaddress.ip_network("2000::/3"):
            return False
    return scheme == "https" and parsed.is_global and not parsed.is_multicast


class _Pinned(http.client.HTTPConnection):
    """A connection to a checked address, with the host name for certificate and Host header."""

    def __init__(self, parts: SplitResult, family: socket.AddressFamily, address: Any) -> None:
        self._secure = parts.scheme == "https"
        # Used in the Host header.
        self.default_port = 443 if self._secure else 80
        super().__init__(parts.hostname or "", address[1])
        self._family, self._address = family, address

    def connect(self) -> None:
        self.sock = socket.socket(self._family, socket.SOCK_STREAM)
        self.sock.settimeout(CONNECT_S)
        self.sock.connect(self._address)
        if self._secure:
            self.sock = certificates().wrap_socket(self.sock, server_hostname=self.host)
        self.sock.settimeout(EXCHANGE_S)

    def abort(self) -> None:
        """End the connection from another thread."""
        if self.sock is not None:
            with suppress(OSError):
                self.sock.shutdown(socket.SHUT_RDWR)
