"""Loopback addresses and networks: of trusted proxies, and those that webhooks may reach."""

import ipaddress
import socket
from ipaddress import IPv4Network, IPv6Network

from bentray_kernels.errors import InvalidInput

Network = IPv4Network | IPv6Network


def is_loopback(host: str) -> bool:
    """Whether a host name or address is reachable from this machine only."""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        pass
    try:
        addresses = socket.getaddrinfo(host, None)
    except (OSError, UnicodeError):
        return False
    return all(ipaddress.ip_address(str(one[4][0]).partition("%")[0]).is_loopback for one in addresses)


def names_loopback(host: str) -> bool:
    """Whether a Host or Origin header is a loopback address or localhost; names are not resolved."""
    name = host.rpartition("://")[2]
    bare = name[1:].partition("]")[0] if name.startswith("[") else name.partition(":")[0]
    try:
        return ipaddress.ip_address(bare).is_loopback
    except ValueError:
        return bare.lower() == "localhost"


def networks(words: str, setting: str = "BENTRAY_TRUSTED_PROXIES") -> tuple[Network, ...]:
    """Parse networks or addresses separated by commas.

    Raises:
        InvalidInput: naming the setting.
    """
    parsed = []
    for word in filter(None, (entry.strip() for entry in words.split(","))):
        try:
            parsed.append(ipaddress.ip_network(word))
        except ValueError:
            accepted = "addresses or networks, as 10.0.0.7,10.1.0.0/16"
            raise InvalidInput(setting, repr(word[:80]), accepted) from None
    return tuple(parsed)


def within(address: str, trusted: tuple[Network, ...]) -> bool:
    """Whether an address is in one of the networks."""
    try:
        parsed = ipaddress.ip_address(address)
    except ValueError:
        return False
    if isinstance(parsed, ipaddress.IPv6Address) and parsed.ipv4_mapped is not None:
        parsed = parsed.ipv4_mapped
    return any(parsed in network for network in trusted if network.version == parsed.version)
