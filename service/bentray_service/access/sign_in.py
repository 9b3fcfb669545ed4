"""Who is let in: decided from the headers of a request and where it comes from, before its body is read."""

from __future__ import annotations

import logging
import math
import time

from starlette.datastructures import Headers

from bentray_kernels.errors import InvalidInput

from ..refusals import Forbidden, NotAuthenticated, RateLimited
from ..rows.api_key import PREFIX, ApiKey
from ..rows.keys import Keys
from ..rows.tenants import LOCAL, tenant_of_user
from ..settings import ServiceSettings
from ..web.addresses import is_loopback, names_loopback, networks, within
from .caller import ANYONE, SCOPES, USUAL, Caller, scope_of
from .request_rates import RequestRates

log = logging.getLogger("bentray.access")

# For how long it is believed that there is no key yet, s.
NO_KEYS_S = 1.0

WAYS_IN = (
    "127.0.0.1; or a first key, made by `bentray keys create`; or BENTRAY_TRUSTED_PROXIES, "
    "the addresses of proxies that ask who calls"
)


class SignIn:
    """Lets callers in.

    Without any key and without trusted proxies, a service that listens on loopback is open: everybody who
    reaches it is the tenant ``local``. Everywhere else, and from the first key on, every caller needs a key
    or comes through a proxy.
    """

    def __init__(self, settings: ServiceSettings, keys: Keys) -> None:
        """Raises:
        InvalidInput: where the service would be open to more than its own machine, or a setting is wrong.
        """
        self._keys = keys
        self._trusted = networks(settings.trusted_proxies or "")
        self._user_header = settings.proxy_user_header
        self._requests = RequestRates(settings.requests_per_minute)
        self._renders = RequestRates(settings.renders_per_minute)
        self._no_keys_until = -math.inf
        if settings.first_key_file is not None and not keys.any():
            self._take_first_key(settings)
        if not self._trusted and not keys.any():
            if not is_loopback(settings.host):
                raise InvalidInput("host", f"{settings.host}, which others reach, without any key", WAYS_IN)
            log.info("no key is asked for: everyone on this machine is the tenant %s", LOCAL)

    def open(self) -> bool:
        """Whether everybody is let in; a key that was just made is known after a second."""
        if self._trusted or self._no_keys_until == math.inf:
            return False
        if time.monotonic() < self._no_keys_until:
            return True
        found = self._keys.any()
        # Once there was a key it stays closed, also when all of them are revoked.
        self._no_keys_until = math.inf if found else time.monotonic() + NO_KEYS_S
        return not found

    def caller(self, headers: Headers, address: str) -> Caller:
        """Whoever sends these headers from this address.

        Raises:
            NotLetIn: without a valid key, nor through a trusted proxy that names a user.
            NotAllowed: at an open door, for a page of another site that makes its reader's browser ask.
        """
        if self.open():
            return self._neighbour(headers)
        scheme, _, given = headers.get("authorization", "").partition(" ")
        if scheme.lower() == "bearer" and given.strip().startswith(PREFIX):
            return self._key_holder(given.strip())
        users = headers.getlist(self._user_header) if within(address, self._trusted) else []
        if len(users) == 1 and users[0].strip():
            user = users[0].strip()
            return Caller(tenant_of_user(user), "proxy", user, frozenset(USUAL))
        found = "nothing" if not scheme else "something that is no key"
        raise NotAuthenticated("Authorization", found, "Bearer and a key; see `bentray keys create`")

    def check(self, caller: Caller, method: str, path: str) -> None:
        """Refuse what is beyond the caller's scopes, or too often.

        Raises:
            NotAllowed, TooOften: as they say.
        """
        needed = scope_of(method, path)
        if needed not in caller.scopes:
            has = ", ".join(sorted(caller.scopes))
            raise Forbidden("scope", has, f"{needed}, to {SCOPES[needed]}")
        self._take(self._requests, "requests", caller)

    def check_render(self, caller: Caller) -> None:
        """Refuse a picture that comes too soon.

        Raises:
            TooOften: as it says.
        """
        self._take(self._renders, "renders", caller)

    def _take(self, rates: RequestRates, what: str, caller: Caller) -> None:
        wait_s = rates.take(caller.tenant) if caller.how != "open" else 0.0
        if wait_s > 0.0:
            raise RateLimited(
                what, f"more than {rates.per_minute} a minute", "fewer; see Retry-After", wait_s
            )

    def _neighbour(self, headers: Headers) -> Caller:
        # A page of another site can make a browser on this machine ask, by a name that it lets mean
        # 127.0.0.1 or by a form; neither names loopback itself.
        for name in ("host", "origin"):
            given = headers.get(name)
            if given is not None and not names_loopback(given):
                accepted = "localhost or 127.0.0.1; from elsewhere a key is needed (`bentray keys create`)"
                raise Forbidden(name.title(), repr(given[:80]), accepted)
        return ANYONE

    def _key_holder(self, given: str) -> Caller:
        token = ApiKey.of(given)
        row = None if token is None else self._keys.owner(token)
        if row is None:
            raise NotAuthenticated(
                "Authorization", "a key that is unknown, revoked or expired", "a valid key"
            )
        return Caller(row["tenant"], "key", row["id"], frozenset(row["scopes"]))

    def _take_first_key(self, settings: ServiceSettings) -> None:
        path = settings.first_key_file
        assert path is not None
        try:
            text = path.read_text().strip()
        except (OSError, UnicodeDecodeError) as error:
            found = f"{path} ({getattr(error, 'strerror', None) or 'no text'})"
            raise InvalidInput("BENTRAY_FIRST_KEY_FILE", found, "a file with a key") from error
        token = ApiKey.given("BENTRAY_FIRST_KEY_FILE", text)
        self._keys.add(token, LOCAL, "first", tuple(SCOPES))
        log.warning("the first key, %s of the tenant %s, was taken from %s", token.id, LOCAL, path)
