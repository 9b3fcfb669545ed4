"""Limits on the number of open connections, in total and per client address."""

from __future__ import annotations

import ipaddress
import logging
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

from .addresses import Network, within

log = logging.getLogger("bentray.connections")

# Maximum number of connections, independent of the number of file descriptors.
MAX_CONNECTIONS = 4096
# Default limit per address, as a fraction of all connections.
PART = 4
# Additional connections for health checks and refusals.
SPARE = 64
# File descriptors reserved for the database, Dask and files of jobs.
KEPT = 128
# File descriptors per connection: the socket and a file.
EACH = 2
# All addresses of an IPv6 network of this size count as one.
IPV6_PREFIX = 64


@dataclass(frozen=True)
class ConnectionLimits:
    """Maximum numbers of connections: in total, per address, and spare ones for short requests."""

    most: int
    of_address: int
    spare: int

    @classmethod
    def of(cls, descriptors: int, in_use: int, of_address: int | None) -> ConnectionLimits:
        """The limits for a number of file descriptors, of which some are in use."""
        most = max(1, min(MAX_CONNECTIONS, (descriptors - in_use - KEPT - SPARE) // EACH))
        return cls(most, min(most, of_address or max(1, most // PART)), SPARE)


class CountedConnection(Protocol):
    """A connection that is counted."""

    def drop(self) -> None:
        """Close it at once."""


class Connections:
    """All open connections.

    A new connection beyond a limit replaces the one that is idle for longest, of the same address or of the
    address with the most connections. If no connection is idle, the new one is *spare*: only short requests
    are answered before it is closed.

    Attributes:
        limits: current limits.
    """

    def __init__(self, limits: ConnectionLimits, trusted: tuple[Network, ...] = ()) -> None:
        """Args:
        limits: initial limits.
        trusted: proxies; only the total limit applies to them.
        """
        self.limits = limits
        self._trusted = trusted
        # Per address, in order of arrival or of becoming idle.
        self._open: dict[str, dict[CountedConnection, None]] = {}
        self._idle: dict[str, dict[CountedConnection, None]] = {}
        self._spare: dict[CountedConnection, str] = {}
        self._where: dict[CountedConnection, str] = {}

    def __len__(self) -> int:
        return len(self._where)

    def add(self, one: CountedConnection, address: str) -> bool:
        """Add a new connection; returns whether it is spare."""
        group = _group(address)
        self._where[one] = group
        limited = not within(address, self._trusted)
        if limited and len(self._open.get(group, ())) >= self.limits.of_address:
            log.warning("more than %d connections from one address", self.limits.of_address)
            full = not self._close_idle(group)
        elif len(self._where) - len(self._spare) > self.limits.most:
            log.warning("more than %d connections in total", self.limits.most)
            full = not (self._idle and self._close_idle(_longest(self._idle)))
        else:
            full = False
        if full:
            self._take_spare(one, group)
        else:
            self._open.setdefault(group, {})[one] = None
            self._idle.setdefault(group, {})[one] = None
        return full

    def busy(self, one: CountedConnection) -> None:
        """A request has started."""
        _take_out(self._idle, self._where.get(one), one)

    def idle(self, one: CountedConnection) -> None:
        """The connection has become idle."""
        group = self._where.get(one)
        if group is not None and one not in self._spare:
            self._idle.setdefault(group, {})[one] = None

    def remove(self, one: CountedConnection) -> None:
        """The connection is closed; may be called more than once."""
        group = self._where.pop(one, None)
        self._spare.pop(one, None)
        _take_out(self._idle, group, one)
        _take_out(self._open, group, one)

    def _close_idle(self, group: str) -> bool:
        for one in self._idle.get(group, ()):
            self.remove(one)
            one.drop()
            return True
        return False

    def _take_spare(self, one: CountedConnection, group: str) -> None:
        if len(self._spare) >= self.limits.spare:
            # Replace the oldest spare connection of the address with the most.
            groups: dict[str, dict[CountedConnection, None]] = {}
            for other, its in self._spare.items():
                groups.setdefault(its, {})[other] = None
            oldest = next(iter(groups[_longest(groups)]))
            self.remove(oldest)
            oldest.drop()
        self._spare[one] = group


def _longest(groups: Mapping[str, dict[CountedConnection, None]]) -> str:
    return max(groups, key=lambda group: len(groups[group]))


def _take_out(
    groups: dict[str, dict[CountedConnection, None]], group: str | None, one: CountedConnection
) -> None:
    if group is not None and group in groups:
        groups[group].pop(one, None)
        if not groups[group]:
            del groups[group]


def _group(address: str) -> str:
    """The group of addresses that are counted together."""
    try:
        parsed = ipaddress.ip_address(address.partition("%")[0])
    except ValueError:
        return address
    if isinstance(parsed, ipaddress.IPv6Address):
        if parsed.ipv4_mapped is not None:
            return str(parsed.ipv4_mapped)
        return str(ipaddress.ip_network((parsed, IPV6_PREFIX), strict=False))
    return str(parsed)
