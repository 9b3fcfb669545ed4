"""Connections to other servers: the proxies and the certificates that the environment names.

The client and the sign-in with OpenID Connect connect by ``Transport`` or ``AsyncTransport``. Webhooks use
``certificates`` alone, since a proxy would choose the address that they must check. The rule is in
``docs/reference/settings.md``.
"""

import ipaddress
import os
import re
import socket
import ssl
from collections.abc import Callable
from fnmatch import fnmatchcase
from functools import cache, partial
from pathlib import Path
from typing import Any, Generic, NamedTuple, TypeVar
from urllib.request import getproxies_environment

import httpx

from bentray_kernels.errors import InvalidInput

SCHEMES = ("http", "https", "socks5", "socks5h")
ACCEPTED_PROXY = "the address of a proxy, as http://proxy.example.org:3128 or socks5://127.0.0.1:1080"
ACCEPTED_EXCEPTION = "names, domains, addresses and networks, as example.org,10.0.0.0/8,[::1]:8000"
ACCEPTED_FILE = "a readable file of certificates in PEM format, or no such variable for the usual ones"
ACCEPTED_FOLDER = "a folder of certificates, or no such variable for the usual ones"

PORTS = {"http": 80, "https": 443}
LAST_PORT = 65535

AnyTransport = TypeVar("AnyTransport", httpx.HTTPTransport, httpx.AsyncHTTPTransport)


class Proxy(NamedTuple):
    """A proxy and the environment variable that names it.

    Attributes:
        variable: its name.
        url: with user and password.
    """

    variable: str
    url: httpx.URL

    def __str__(self) -> str:
        return f"the proxy {self.url.copy_with(userinfo=b'')} ({self.variable})"


def proxy_for(url: httpx.URL) -> Proxy | None:
    """The proxy that the environment names for an address; None for a direct connection.

    Raises:
        InvalidInput: naming the variable, for a proxy or an exception that cannot be understood.
    """
    if _is_this_machine(url.host):
        return None
    settings = getproxies_environment()
    variable = proxy_variable(url.scheme)
    if not variable or _is_exception(url, settings.get("no", "")):
        return None
    value = os.environ[variable].strip()
    try:
        proxy = httpx.URL(value if "://" in value else f"http://{value}")
    except httpx.InvalidURL:
        proxy = httpx.URL()
    if proxy.scheme not in SCHEMES or not proxy.host or (proxy.port or 0) > LAST_PORT:
        # The user and the password are not shown.
        raise InvalidInput(variable, repr(value.rpartition("@")[2][:100]), ACCEPTED_PROXY)
    return Proxy(variable, proxy)


def proxy_variable(scheme: str) -> str:
    """The name of the variable with the proxy for ``http`` or ``https``; empty if none is set."""
    settings = getproxies_environment()
    return next((_variable(kind) for kind in (scheme, "all") if settings.get(kind, "").strip()), "")


def through_proxy(url: httpx.URL) -> str:
    """Words for a message about a request: the proxy and its variable; empty for a direct connection."""
    proxy = proxy_for(url)
    return f" through {proxy}" if proxy else ""


def certificates() -> ssl.SSLContext:
    """The authorities to trust: of ``SSL_CERT_FILE`` and ``SSL_CERT_DIR``, else of the system and certifi.

    Raises:
        InvalidInput: naming the variable, for a file or a folder that cannot be read.
    """
    return _certificates(os.environ.get("SSL_CERT_FILE", ""), os.environ.get("SSL_CERT_DIR", ""))


class Transport(httpx.BaseTransport):
    """Sends each request directly or through the proxy of its address; safe in threads.

    Raises:
        InvalidInput: for a request, as ``proxy_for`` and ``certificates``.
    """

    def __init__(self, retries: int = 0) -> None:
        """Args:
        retries: of a failed connection.
        """
        self._routes = _Routes(partial(httpx.HTTPTransport, retries=retries))

    def handle_request(self, request: httpx.Request) -> httpx.Response:
        return self._routes.to(request.url).handle_request(request)

    def close(self) -> None:
        for transport in self._routes.transports.values():
            transport.close()


class AsyncTransport(httpx.AsyncBaseTransport):
    """Like ``Transport``, asynchronous."""

    def __init__(self, retries: int = 0) -> None:
        self._routes = _Routes(partial(httpx.AsyncHTTPTransport, retries=retries))

    async def handle_async_request(self, request: httpx.Request) -> httpx.Response:
        return await self._routes.to(request.url).handle_async_request(request)

    async def aclose(self) -> None:
        for transport in self._routes.transports.values():
            await transport.aclose()


class _Routes(Generic[AnyTransport]):
    """Transports by proxy, apart for encrypted connections, so that others read no certificates."""

    def __init__(self, make: Callable[..., AnyTransport]) -> None:
        self._make: Callable[..., AnyTransport] = make
        self.transports: dict[Any, AnyTransport] = {}

    def to(self, url: httpx.URL) -> AnyTransport:
        proxy = proxy_for(url)
        encrypted = "https" in (url.scheme, proxy.url.scheme if proxy else "")
        key = (proxy, encrypted)
        if key not in self.transports:
            # Without certificates nothing is trusted.
            trusted = certificates() if encrypted else ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
            route = None
            if proxy is not None:
                context = trusted if proxy.url.scheme == "https" else None
                route = httpx.Proxy(proxy.url, ssl_context=context)
            self.transports.setdefault(key, self._make(verify=trusted, proxy=route))
        return self.transports[key]


def _variable(kind: str) -> str:
    """The name of the variable of a kind of proxies: the lower-case one takes precedence, as in urllib."""
    name = f"{kind}_proxy"
    return name if os.environ.get(name) else name.upper()


def _address(host: str) -> ipaddress.IPv4Address | ipaddress.IPv6Address | None:
    """The address that a host is, also in short or decimal form; None for a name."""
    try:
        address = ipaddress.ip_address(host)
    except ValueError:
        try:
            return ipaddress.IPv4Address(socket.inet_aton(host))
        except (OSError, UnicodeError):
            return None
    return getattr(address, "ipv4_mapped", None) or address


def _is_this_machine(host: str) -> bool:
    address = _address(host)
    if address is not None:
        return address.is_loopback or address.is_unspecified
    return host.lower().rstrip(".").rpartition(".")[2] == "localhost"


def _is_exception(url: httpx.URL, exceptions: str) -> bool:
    """Whether one of the words of ``NO_PROXY`` fits; host names are not resolved."""
    return any(_fits(word, url) for word in re.split(r"[\s,]+", exceptions.lower()) if word)


def _fits(word: str, url: httpx.URL) -> bool:
    host, address = url.host.lower().rstrip("."), _address(url.host)
    if "/" in word:
        try:
            network = ipaddress.ip_network(word.replace("[", "").replace("]", ""), strict=False)
        except ValueError:
            raise InvalidInput(_variable("no"), repr(word[:80]), ACCEPTED_EXCEPTION) from None
        return address is not None and address in network
    name, port = word, ""
    if word.startswith("["):
        name, _, port = word[1:].partition("]")
    elif word.count(":") == 1:
        name, _, port = word.partition(":")
    if port.strip(":") not in ("", str(url.port or PORTS.get(url.scheme))):
        return False
    if (excepted := _address(name)) is not None:
        return excepted == address
    if "*" in name:
        return fnmatchcase(host, name)
    domain = name.strip(".")
    return host == domain or host.endswith(f".{domain}")


@cache
def _certificates(file: str, folders: str) -> ssl.SSLContext:
    if file:
        try:
            ssl.create_default_context(cafile=file)
        except OSError as error:
            reason = "no certificate in it" if isinstance(error, ssl.SSLError) else error.strerror
            given = f"{file} ({reason})"
            raise InvalidInput("SSL_CERT_FILE", given, ACCEPTED_FILE) from None
    if folders and not any(Path(folder).is_dir() for folder in folders.split(os.pathsep)):
        raise InvalidInput("SSL_CERT_DIR", f"{folders} (no such folder)", ACCEPTED_FOLDER)
    # OpenSSL reads both variables itself; without them httpx brings the authorities of certifi.
    trusted = ssl.create_default_context() if file or folders else httpx.create_ssl_context(trust_env=False)
    trusted.load_default_certs()
    return trusted
