"""Addresses of webhooks: which are permitted, and one POST to such an address.

A service that calls addresses of its clients must not reach what only it can reach. Therefore a host name is
resolved once, its addresses are checked, and the connection is made to the checked address; redirects are not
followed. Proxies of the environment are not used: a proxy resolves the name again, perhaps differently.
"""

import errno
import ipaddress
import logging
import socket
import ssl
import time
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple
from urllib.parse import SplitResult, urlsplit

import h11

from bentray_kernels.errors import InvalidInput

from ..web.addresses import Network, within
from ..web.outbound import certificates, proxy_variable

log = logging.getLogger("bentray.webhooks")

LONGEST_URL = 2000
# Time limits of the connection, and of the whole exchange, s.
CONNECT_S = 5.0
EXCHANGE_S = 15.0
ACCEPTED = "an https address on the public internet, without user and fragment"

# Longest headers of a response, bytes.
LONGEST_HEADERS = 64 * 1024

# IPv6 networks of which the last 32 bits are the IPv4 address that is reached: mapped addresses and NAT64.
EMBEDDING = (ipaddress.ip_network("::ffff:0:0/96"), ipaddress.ip_network("64:ff9b::/96"))
# Assigned as unicast to the public. Outside are loopback, mapped, unique local, link-local and multicast
# addresses, discard (100::/64), dummy (100:0:0:1::/64), local NAT64 (64:ff9b:1::/48) and SRv6 (5f00::/16).
UNICAST = ipaddress.ip_network("2000::/3")
# Source: the IANA registries of special-purpose addresses for IPv4 and IPv6 (RFC 6890), as of 2025, whole:
# also what is globally reachable there is infrastructure, as anycast relays and AS112, and no receiver.
RESERVED = tuple(
    ipaddress.ip_network(network)
    for network in (
        # This network, private use, shared (carriers), loopback, link-local.
        *("0.0.0.0/8", "10.0.0.0/8", "100.64.0.0/10", "127.0.0.0/8", "169.254.0.0/16", "172.16.0.0/12"),
        # IETF protocols, documentation, AS112, AMT, 6to4 relays, private use, AS112.
        *("192.0.0.0/24", "192.0.2.0/24", "192.31.196.0/24", "192.52.193.0/24", "192.88.99.0/24"),
        *("192.168.0.0/16", "192.175.48.0/24"),
        # Benchmarks, documentation, reserved and broadcast.
        *("198.18.0.0/15", "198.51.100.0/24", "203.0.113.0/24", "240.0.0.0/4"),
        # IETF protocols with Teredo and ORCHID, documentation, 6to4, AS112, documentation.
        *("2001::/23", "2001:db8::/32", "2002::/16", "2620:4f:8000::/48", "3fff::/20"),
        # Beside the registries: multicast (RFC 5771), and the host of virtual machines of Azure, which
        # answers them alone.
        *("224.0.0.0/4", "168.63.129.16/32"),
    )
)


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
        address = urlsplit(url)
        port = address.port
    except ValueError:
        raise InvalidInput("webhook", shown, ACCEPTED) from None
    host = address.hostname or ""
    plain = url.isascii() and url.isprintable() and " " not in url and len(url) <= LONGEST_URL
    if not (plain and host and address.scheme in ("http", "https") and port != 0):
        raise InvalidInput("webhook", shown, f"{ACCEPTED}, at most {LONGEST_URL} characters")
    if address.username is not None or address.fragment:
        raise InvalidInput("webhook", "an address with user or fragment", ACCEPTED)
    if address.scheme == "http" and not permitted:
        raise InvalidInput("webhook", shown, f"{ACCEPTED} (http only within BENTRAY_WEBHOOK_NETWORKS)")
    if _is_address(host) and not _is_permitted(host, address.scheme, permitted):
        raise InvalidInput("webhook", shown, f"{ACCEPTED}, or within BENTRAY_WEBHOOK_NETWORKS")
    return address


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
        address = check_url(url, permitted)
        status = _exchange(address, headers, body, permitted, begun + EXCHANGE_S)
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
    except (OSError, h11.ProtocolError) as failed:
        error = f"no answer: {getattr(failed, 'strerror', None) or 'no response of HTTP'}"
        if variable := proxy_variable(urlsplit(url).scheme):
            error += f" (webhooks do not use {variable})"
    return Outcome(status, error, round(time.monotonic() - begun, 3))


def _exchange(
    receiver: SplitResult, headers: Mapping[str, str], body: bytes, permitted: Sequence[Network], end: float
) -> int:
    """Send a request to a checked address; returns the status of the response, whose body is not read.

    Args:
        end: of the exchange, on the monotonic clock.
    """
    host = receiver.hostname or ""
    family, address = _permitted_address(host, receiver, permitted)
    shown = f"[{host}]" if ":" in host else host
    if address[1] != (443 if receiver.scheme == "https" else 80):
        shown += f":{address[1]}"
    target = f"{receiver.path or '/'}?{receiver.query}" if receiver.query else receiver.path or "/"
    lines = [("Host", shown), ("Content-Length", str(len(body))), ("Connection", "close"), *headers.items()]
    request = h11.Request(method="POST", target=target, headers=lines)
    with socket.socket(family, socket.SOCK_STREAM) as connection:
        connection.settimeout(min(CONNECT_S, _left(end)))
        connection.connect(address)
        if receiver.scheme != "https":
            return _answer(connection, request, body, end)
        with certificates().wrap_socket(connection, server_hostname=host) as secured:
            return _answer(secured, request, body, end)


def _answer(connection: socket.socket, request: h11.Request, body: bytes, end: float) -> int:
    """Send a request; returns the status of its response when all headers have come."""
    protocol, came = h11.Connection(h11.CLIENT, LONGEST_HEADERS), 0
    events = request, h11.Data(data=body), h11.EndOfMessage()
    connection.settimeout(_left(end))
    connection.sendall(b"".join(protocol.send(event) or b"" for event in events))
    while not isinstance(event := protocol.next_event(), h11.Response):
        if event is not h11.NEED_DATA:
            # An interim response (1xx).
            continue
        # A receiver that sends one byte now and then would never exceed the limit of a single operation.
        connection.settimeout(_left(end))
        piece = connection.recv(LONGEST_HEADERS)
        came += len(piece)
        if not piece or came > LONGEST_HEADERS:
            cause = f"more than {LONGEST_HEADERS} bytes of headers" if piece else "the connection was closed"
            raise OSError(errno.EPROTO, cause)
        protocol.receive_data(piece)
    return event.status_code


def _left(end: float) -> float:
    """Time until ``end``, s.

    Raises:
        TimeoutError: when it has passed.
    """
    left = end - time.monotonic()
    if left <= 0.0:
        raise TimeoutError
    return left


def _permitted_address(
    host: str, receiver: SplitResult, permitted: Sequence[Network]
) -> tuple[socket.AddressFamily, Any]:
    """The first permitted address of a host, as the functions of sockets take it."""
    port = receiver.port or (443 if receiver.scheme == "https" else 80)
    try:
        addresses = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)
    except (OSError, UnicodeError):
        raise InvalidInput("webhook", "a host name that is not known", ACCEPTED) from None
    for family, _, _, _, address in addresses:
        text = str(address[0])
        # A zone belongs to an address of the local link only.
        if "%" not in text and _is_permitted(text, receiver.scheme, permitted):
            return family, address
    # The addresses themselves are not shown: names of the inner network are not for tenants.
    raise InvalidInput("webhook", "a host without a permitted address", ACCEPTED)


def _is_permitted(address: str, scheme: str, permitted: Sequence[Network]) -> bool:
    """Whether an address may be called: public with TLS, or within a permitted network."""
    if within(address, tuple(permitted)):
        return True
    parsed = ipaddress.ip_address(address)
    if any(parsed in network for network in EMBEDDING):
        return _is_permitted(str(ipaddress.IPv4Address(int(parsed) & 0xFFFFFFFF)), scheme, permitted)
    unicast = parsed.version == 4 or parsed in UNICAST
    return scheme == "https" and unicast and not any(parsed in network for network in RESERVED)
