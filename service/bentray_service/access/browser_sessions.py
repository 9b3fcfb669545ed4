"""Sign-in of browsers at an OpenID provider (authorization code flow with PKCE), and their sessions."""

import logging
import re
from collections.abc import Mapping
from dataclasses import dataclass
from urllib.parse import urlsplit

from starlette.datastructures import Headers
from starlette.requests import HTTPConnection

from bentray_kernels.errors import InvalidInput

from ..errors import Forbidden, NotAuthenticated
from ..rows.keys import PENDING_S, ClaimedTenants, PendingSignIn, Sessions
from ..settings import ServiceSettings
from ..web.addresses import names_loopback
from .caller import Caller
from .openid import ClaimMapping, Provider

log = logging.getLogger("bentray.access")

CALLBACK = "/sign-in/callback"
# The part of the page to return to: after a fragment sign, so that no response leads to another site.
ADDRESS = re.compile(r"#/[A-Za-z0-9/_.,:=&?%+~-]{0,480}")
START = "#/"
SAFE_METHODS = ("GET", "HEAD", "OPTIONS")


@dataclass(frozen=True)
class Cookie:
    """A cookie to set; one without a value is deleted."""

    name: str
    value: str
    seconds: float
    secure: bool
    same_site: str

    def header(self) -> str:
        """The value of Set-Cookie. Scripts cannot read the cookie, and it belongs to this host alone."""
        words = [f"{self.name}={self.value}", "Path=/", f"Max-Age={int(self.seconds) if self.value else 0}"]
        return "; ".join(
            [*words, "HttpOnly", f"SameSite={self.same_site}", *(["Secure"] if self.secure else [])]
        )


class BrowserSessions:
    """Signs users in and out, and finds the session of a request."""

    def __init__(self, settings: ServiceSettings, sessions: Sessions, claimed: ClaimedTenants) -> None:
        """Raises:
        InvalidInput: for an invalid or a missing setting.
        """
        url = settings.public_url
        if url is None:
            raise InvalidInput("BENTRAY_PUBLIC_URL", "nothing", "the address of this service for browsers")
        address = urlsplit(url)
        self._secure = address.scheme == "https"
        if not self._secure and not names_loopback(address.netloc):
            raise InvalidInput("BENTRAY_PUBLIC_URL", url, "an https address, since cookies need encryption")
        self._origin = f"{address.scheme}://{address.netloc.lower()}"
        self._sessions = sessions
        self._provider = Provider(settings)
        self._mapping = ClaimMapping(settings, claimed)
        self._seconds = settings.session_hours * 3600.0
        self.name = settings.oidc_name or urlsplit(self._provider.issuer).hostname or ""
        # Browsers accept names with this prefix only with Secure, for one host and from it.
        prefix = "__Host-" if self._secure else ""
        self._session, self._pending = f"{prefix}bentray", f"{prefix}bentray-sign-in"

    def close(self) -> None:
        self._provider.close()

    def begin(self, address: str) -> tuple[str, Cookie]:
        """Begin a sign-in: the address of the provider, and the cookie that binds it to this browser.

        Args:
            address: part of the page to return to; another text leads to the start.

        Raises:
            ProviderUnavailable: as its name says.
        """
        pending = PendingSignIn.new()
        url = self._provider.authorization_url(
            self._origin + CALLBACK, pending.state, pending.nonce, pending.verifier
        )
        self._sessions.begin(pending, address if ADDRESS.fullmatch(address) else START)
        # It must arrive with the redirect from the provider, hence Lax.
        return url, Cookie(self._pending, pending.browser, PENDING_S, self._secure, "Lax")

    def finish(self, query: Mapping[str, str], headers: Headers) -> tuple[str, Caller, list[Cookie]]:
        """End a sign-in: the address of the page, the user, and the cookies to set.

        Args:
            query: of the response of the provider.
            headers: of the request.

        Raises:
            NotAuthenticated: when the response is not valid.
            Forbidden: when the user may not use the service.
            ProviderUnavailable: as its name says.
        """
        browser = _cookies(headers).get(self._pending, "")
        pending = self._sessions.take(query.get("state", ""), browser)
        if pending is None:
            given = "a sign-in that is unknown, used, expired or of another browser"
            raise NotAuthenticated("state", given, "a new sign-in")
        # RFC 9207: a response of another provider is not ours to exchange.
        if query.get("iss", self._provider.issuer) != self._provider.issuer:
            raise NotAuthenticated("iss", "another provider", self._provider.issuer)
        if "code" not in query:
            given = repr(query.get("error", "nothing")[:80])
            raise NotAuthenticated("code", f"{given} from the provider", "a code; sign in again")
        claims = self._provider.claims(
            query["code"],
            self._origin + CALLBACK,
            pending.nonce,
            pending.verifier,
            self._mapping.names(),
        )
        user = self._mapping.identity(claims)
        # A session of before ends, so that nobody finds themselves in that of another.
        self._end(headers)
        secret, row = self._sessions.start(user.tenant, user.who, user.scopes, self._seconds)
        caller = Caller(row.tenant, "session", row.who, frozenset(row.scopes), (row.id,))
        cookies = [
            Cookie(self._pending, "", 0.0, self._secure, "Lax"),
            Cookie(self._session, secret, self._seconds, self._secure, "Strict"),
        ]
        return f"{self._origin}/{pending.address}", caller, cookies

    def caller(self, headers: Headers, method: str) -> Caller | None:
        """The user of the session of a request; None without a valid session.

        Raises:
            Forbidden: for changes that another web site requests.
        """
        secret = _cookies(headers).get(self._session)
        row = self._sessions.owner(secret) if secret else None
        if row is None:
            return None
        if method not in SAFE_METHODS:
            self._check_origin(headers)
        return Caller(row.tenant, "session", row.who, frozenset(row.scopes), (row.id,))

    def sign_out(self, headers: Headers) -> tuple[Caller | None, str | None, Cookie]:
        """End the session of a request: who it was, where to sign out at the provider, the cookie to delete.

        Raises:
            Forbidden: when another web site requests it.
        """
        caller = self.caller(headers, "POST")
        self._end(headers)
        try:
            url = self._provider.logout_url(f"{self._origin}/")
        except InvalidInput as error:
            log.warning("no sign-out at the provider: %s", error)
            url = None
        return caller, url, Cookie(self._session, "", 0.0, self._secure, "Strict")

    def _end(self, headers: Headers) -> None:
        secret = _cookies(headers).get(self._session)
        if secret:
            self._sessions.end(secret)

    def _check_origin(self, headers: Headers) -> None:
        # The cookie is SameSite=Strict; this also refuses other hosts of the same site.
        origin = headers.get("origin", "nothing")
        if origin.lower() != self._origin:
            raise Forbidden("Origin", repr(origin[:80]), f"{self._origin}: requests of the page itself")


def _cookies(headers: Headers) -> dict[str, str]:
    return HTTPConnection({"type": "http", "headers": headers.raw}).cookies
