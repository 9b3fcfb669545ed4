"""How many connections may be open, of one address and in all, and which one goes beyond that."""

from __future__ import annotations

import ipaddress
import logging
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

from .addresses import Network, within

log = logging.getLogger("bentray.connections")

# Beyond all of these a browser or a program of one address does not go, and memory is not the bound.
MOST = 4096
# Of one address where no other number is set: this part of all.
PART = 4
# Kept for connections that are closed or refused, and for those that ask whether the service lives.
SPARE = 64
# Descriptors kept for the database, Dask and the files of the jobs.
KEPT = 128
# A connection and the file that is written or read for it.
EACH = 2
# Of an IPv6 network that one customer is given, every address is the same to us.
IPV6_PREFIX = 64


@dataclass(frozen=True)
class ConnectionLimits:
    """Numbers of open connections: in all, of one address, and beyond them for short questions."""

    most: int
    of_address: int
    spare: int

    @classmethod
    def of(cls, descriptors: int, in_use: int, of_address: int | None) -> ConnectionLimits:
        """What ``descriptors``, of which some are in use, suffice for."""
        most = max(1, min(MOST, (descriptors - in_use - KEPT - SPARE) // EACH))
        return cls(most, min(most, of_address or max(1, most // PART)), SPARE)


class CountedConnection(Protocol):
    """One that is counted."""

    def drop(self) -> None:
        """Close it at once."""


class Connections:
    """All that are open.

    A new one that goes beyond a limit takes the place of one on which nothing is asked: of the longest silent
    one of its address, or of the address with the most. Where every one is at work it is *spare*: the
    service then answers on it only what is short, and closes it.

    Attributes:
        limits: may be set anew.
    """

    def __init__(self, limits: ConnectionLimits, trusted: tuple[Network, ...] = ()) -> None:
        """Args:
        limits: see there.
        trusted: proxies, which bring the requests of many: for each of them only the limit in all holds.
        """
        self.limits = limits
        self._trusted = trusted
        # Per address, in the order in which they came or fell silent.
        self._open: dict[str, dict[CountedConnection, None]] = {}
        self._silent: dict[str, dict[CountedConnection, None]] = {}
        self._spare: dict[CountedConnection, str] = {}
        self._where: dict[CountedConnection, str] = {}

    def __len__(self) -> int:
        return len(self._where)

    def add(self, one: CountedConnection, address: str) -> bool:
        """Count a new connection; whether it is spare."""
        group = _group(address)
        self._where[one] = group
        limited = not within(address, self._trusted)
        if limited and len(self._open.get(group, ())) >= self.limits.of_address:
            log.warning("more than %d connections of one address are open", self.limits.of_address)
            full = not self._drop_silent(group)
        elif len(self._where) - len(self._spare) > self.limits.most:
            log.warning("more than %d connections are open", self.limits.most)
            full = not (self._silent and self._drop_silent(_longest(self._silent)))
        else:
            full = False
        if full:
            self._take_spare(one, group)
        else:
            self._open.setdefault(group, {})[one] = None
            self._silent.setdefault(group, {})[one] = None
        return full

    def busy(self, one: CountedConnection) -> None:
        """A request has come."""
        _take_out(self._silent, self._where.get(one), one)

    def silent(self, one: CountedConnection) -> None:
        """It has been answered, and no other has come."""
        group = self._where.get(one)
        if group is not None and one not in self._spare:
            self._silent.setdefault(group, {})[one] = None

    def remove(self, one: CountedConnection) -> None:
        """It is closed; may be called more than once."""
        group = self._where.pop(one, None)
        self._spare.pop(one, None)
        _take_out(self._silent, group, one)
        _take_out(self._open, group, one)

    def _drop_silent(self, group: str) -> bool:
        for one in self._silent.get(group, ()):
            self.remove(one)
            one.drop()
            return True
        return False

    def _take_spare(self, one: CountedConnection, group: str) -> None:
        if len(self._spare) >= self.limits.spare:
            # The oldest of whoever has the most: an answer on one of these takes no time.
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
    """What counts as one address."""
    try:
        found = ipaddress.ip_address(address.partition("%")[0])
    except ValueError:
        return address
    if isinstance(found, ipaddress.IPv6Address):
        if found.ipv4_mapped is not None:
            return str(found.ipv4_mapped)
        return str(ipaddress.ip_network((found, IPV6_PREFIX), strict=False))
    return str(found)
