"""Authentication of requests by API key, trusted proxy or session, before the body is read."""

import logging
import math
import time
from dataclasses import replace

from starlette.datastructures import Headers

from bentray_kernels.errors import InvalidInput

from ..errors import Forbidden, NotAuthenticated, RateLimited
from ..rows.accounts import Accounts
from ..rows.database import Database
from ..rows.ids import LOCAL, Tenant
from ..rows.keys import PREFIX, ApiKey, ClaimedTenants, Keys, Sessions
from ..rows.projects import ROLES, Projects, membership
from ..settings import ServiceSettings, read_secret
from ..web.addresses import is_loopback, names_loopback, networks, within
from .browser_sessions import BrowserSessions
from .caller import ANYONE, SCOPES, USUAL, Caller, scope_of
from .key_watch import KeyWatch
from .openid import LONGEST_USER
from .rate_limits import RateLimits

log = logging.getLogger("bentray.access")

# Names the project in which a request acts.
PROJECT_HEADER = "Bentray-Project"

# The client of a proxy.
FORWARDED = "X-Forwarded-For"
THIS_MACHINE = networks("127.0.0.0/8, ::1")

# Sign-ins that an address may begin per minute.
SIGN_INS_PER_MINUTE = 60

# Time for which the absence of keys is cached, s.
NO_KEYS_S = 1.0

ACCEPTED_HOSTS = (
    "127.0.0.1 without a proxy; or a first key, created with `bentray keys create`; or "
    "BENTRAY_TRUSTED_PROXIES, the addresses of authenticating proxies; or BENTRAY_OIDC_ISSUER, an OpenID "
    "provider"
)


class SignIn:
    """Authenticates callers.

    Without any key, trusted proxy and OpenID provider, a service on a loopback address needs no
    authentication; every caller is the tenant ``local``. Otherwise every caller needs a key, a trusted
    proxy or a session.

    Attributes:
        projects: of all tenants.
        watch: the requests in progress, which end with their key or session.
        browsers: sessions of users who signed in at the OpenID provider; None without one.
    """

    def __init__(self, settings: ServiceSettings, database: Database, accounts: Accounts) -> None:
        """Raises:
        InvalidInput: if the service would be open to other machines, or for an invalid setting.
        """
        self._keys, sessions = Keys(database), Sessions(database)
        self.projects = Projects(database)
        self.watch = KeyWatch(self._keys, sessions, self.projects)
        self._accounts, self._claimed = accounts, ClaimedTenants(database)
        self._trusted = networks(settings.trusted_proxies or "")
        self._forwarding = networks(settings.behind_proxy or "", "BENTRAY_BEHIND_PROXY")
        self._user_header = settings.proxy_user_header
        self.browsers = None
        if settings.oidc_issuer is not None:
            self.browsers = BrowserSessions(settings, sessions, self._claimed)
        self._guarded = bool(self._trusted) or self.browsers is not None
        self._sign_ins = RateLimits(SIGN_INS_PER_MINUTE)
        self._requests = RateLimits(settings.requests_per_minute)
        self._renders = RateLimits(settings.renders_per_minute)
        self._no_keys_until = -math.inf
        if settings.first_key_file is not None and not self._keys.any():
            self._create_first_key(settings)
        if not self._guarded and not self._keys.any():
            if self._forwarding or not is_loopback(settings.host):
                where = f"{settings.host} behind a proxy" if self._forwarding else settings.host
                raise InvalidInput("host", f"{where}, reachable by others, without any key", ACCEPTED_HOSTS)
            log.info("no key required: every caller on this machine is the tenant %s", LOCAL)

    def close(self) -> None:
        """Close the connection to the provider."""
        if self.browsers is not None:
            self.browsers.close()

    def required(self) -> bool:
        """Whether authentication is required, as the database has it now."""
        return self._guarded or self._keys.any()

    def open(self) -> bool:
        """Whether authentication is not required; a new key is noticed after a second."""
        if self._guarded or self._no_keys_until == math.inf:
            return False
        if time.monotonic() < self._no_keys_until:
            return True
        any_key = self._keys.any()
        # Once a key existed, authentication stays required, even if all keys are revoked.
        self._no_keys_until = math.inf if any_key else time.monotonic() + NO_KEYS_S
        return not any_key

    def caller(self, headers: Headers, address: str, method: str = "GET") -> Caller:
        """Authenticate a request by its headers, client address and method.

        Raises:
            NotAuthenticated: without a valid key, a user from a trusted proxy or a session.
            Forbidden: without authentication or with a session, for requests of other web sites.
        """
        if self.open():
            return self._local_caller(headers)
        scheme, _, credentials = headers.get("authorization", "").partition(" ")
        if scheme.lower() == "bearer" and credentials.strip().startswith(PREFIX):
            return self._caller_with_key(credentials.strip())
        users = headers.getlist(self._user_header) if within(address, self._trusted) else []
        if len(users) == 1 and users[0].strip(" \t"):
            # Bytes of UTF-8 may be spaces of Latin-1; without them the name would be that of another user.
            user = users[0].strip(" \t")
            if len(user) > LONGEST_USER:
                raise NotAuthenticated(
                    self._user_header, f"{len(user)} characters", f"at most {LONGEST_USER}"
                )
            tenant = self._claimed.tenant("proxy", self._user_header.lower(), user, user)
            return Caller(tenant, "proxy", user, frozenset(USUAL))
        found = "nothing" if not scheme else "something that is not a key"
        accepted = "Bearer and a key; see `bentray keys create`"
        if self.browsers is not None:
            caller = self.browsers.caller(headers, method) if not scheme else None
            if caller is not None:
                return caller
            accepted += f"; or a session: sign in at {self.browsers.name}"
        raise NotAuthenticated("Authorization", found, accepted)

    def in_project(self, caller: Caller, headers: Headers) -> Caller:
        """The caller in the project that a request names, with the permissions of its role there.

        Raises:
            UnknownId: when the caller is no member of it.
        """
        name = headers.get(PROJECT_HEADER)
        if name is None:
            return caller
        project = self.projects.get(caller.tenant, name, caller.member)
        ends = () if caller.member is None else (membership(project.id, caller.member),)
        return replace(
            caller,
            tenant=Tenant(project.id),
            scopes=caller.scopes.intersection(ROLES[project.role]),
            ends=(*caller.ends, *ends),
            project=project.id,
            role=project.role,
            owner=caller.tenant,
        )

    def check(self, caller: Caller, method: str, path: str) -> None:
        """Check the scopes and the rate limit of a caller.

        Raises:
            Forbidden, RateLimited: as their names say.
        """
        needed = scope_of(method, path)
        if needed not in caller.scopes:
            has = ", ".join(sorted(caller.scopes))
            raise Forbidden("scope", has, f"{needed}, to {SCOPES[needed]}")
        self._take(self._requests, "requests", caller)

    def check_render(self, caller: Caller, share: float = 1.0) -> None:
        """Check the rate limit for rendered images.

        Args:
            caller: who requests it.
            share: what it counts, at most 1.

        Raises:
            RateLimited: when it is exceeded.
        """
        self._take(self._renders, "renders", caller, share)

    def check_sign_in(self, address: str) -> None:
        """Check the rate limit of an address for sign-ins; proxies have limits of their own.

        Raises:
            RateLimited: when it is exceeded.
        """
        wait_s = 0.0 if within(address, self._trusted + self._forwarding) else self._sign_ins.take(address)
        if wait_s > 0.0:
            found = f"more than {SIGN_INS_PER_MINUTE} per minute"
            raise RateLimited("sign-ins", found, "a lower rate; see Retry-After", wait_s)

    def _take(self, rates: RateLimits, what: str, caller: Caller, share: float = 1.0) -> None:
        wait_s = rates.take(self._accounts.of(caller.tenant), share) if caller.how != "open" else 0.0
        if wait_s > 0.0:
            raise RateLimited(
                what, f"more than {rates.per_minute} per minute", "a lower rate; see Retry-After", wait_s
            )

    def _local_caller(self, headers: Headers) -> Caller:
        # A page of another site can send requests from a browser on this machine, with DNS rebinding or a
        # form; its Host or Origin is not a loopback address.
        for name in ("host", "origin"):
            value = headers.get(name)
            if value is not None and not names_loopback(value):
                accepted = "localhost or 127.0.0.1; other names require a key (`bentray keys create`)"
                raise Forbidden(name.title(), repr(value[:80]), accepted)
        # The other headers of a proxy may be claimed by its client.
        for value in ", ".join(headers.getlist(FORWARDED)).split(","):
            if value.strip() and not within(value.strip(), THIS_MACHINE):
                raise Forbidden(FORWARDED, repr(value[:80]), "this machine; behind a proxy a key is required")
        return ANYONE

    def _caller_with_key(self, text: str) -> Caller:
        token = ApiKey.from_text(text)
        row = None if token is None else self._keys.owner(token)
        if row is None:
            raise NotAuthenticated(
                "Authorization", "a key that is unknown, revoked or expired", "a valid key"
            )
        return Caller(row.tenant, "key", row.id, frozenset(row.scopes), (row.id,))

    def _create_first_key(self, settings: ServiceSettings) -> None:
        path = settings.first_key_file
        assert path is not None
        text = read_secret(path, "BENTRAY_FIRST_KEY_FILE").strip()
        token = ApiKey.given("BENTRAY_FIRST_KEY_FILE", text)
        self._keys.add(token, LOCAL, "first", tuple(SCOPES))
        log.warning("created the first key, %s of the tenant %s, from %s", token.id, LOCAL, path)
