"""A provider of OpenID Connect: verified claims in exchange for a code, and the tenant and scopes they give.

Requests and the rules of ID tokens are those of Authlib, signatures those of joserfc. The HTTP clients of
Authlib are not used: they read answers without a bound, and keys again for every unknown key id.

References: OpenID Connect Core 1.0 and Discovery 1.0; RFC 7636 (PKCE); RFC 9207 (issuer in the response).
"""

import json
import logging
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, TypeVar
from urllib.parse import quote_plus, urlsplit

import httpx
from authlib.common.urls import add_params_to_uri
from authlib.oauth2.auth import ClientAuth
from authlib.oauth2.client import OAuth2Client
from authlib.oauth2.rfc6749.parameters import prepare_token_request
from authlib.oidc.core import CodeIDToken
from joserfc import jwt
from joserfc.errors import BadSignatureError, ClaimError, InvalidKeyIdError, JoseError
from joserfc.jwk import KeySet

from bentray_kernels.errors import InvalidInput

from ..errors import Forbidden, NotAuthenticated, ProviderUnavailable
from ..rows.ids import Tenant, checked_tenant
from ..rows.keys import ClaimedTenants
from ..settings import ServiceSettings, read_secret
from ..web.addresses import names_loopback
from ..web.outbound import Transport, certificates, proxy_for, through_proxy
from .caller import USUAL, checked_scopes

log = logging.getLogger("bentray.access")

# Asymmetric signatures alone: with HS256 the public key, or the client secret, would sign.
ALGORITHMS = (
    "RS256",
    "RS384",
    "RS512",
    "PS256",
    "PS384",
    "PS512",
    "ES256",
    "ES384",
    "ES512",
    "EdDSA",
    "Ed25519",
)
PATIENCE_S = 10.0
# Age at which the discovery document and the keys are read again, s.
FRESH_S = 3600.0
# Shortest interval between two readings for an unknown key: providers rotate keys, attackers invent them, s.
ROTATION_S = 30.0
# Difference of clocks that is tolerated, s.
LEEWAY_S = 60
MAX_BYTES = 1 << 20
NEEDED = ("authorization_endpoint", "token_endpoint", "jwks_uri")
OPTIONAL = ("userinfo_endpoint", "end_session_endpoint")

LONGEST_USER = 200
# OpenID Connect Core, 2.
LONGEST_SUBJECT = 255
Checked = TypeVar("Checked")


class Provider:
    """The provider that the settings name, for one client (this service). Safe in threads."""

    def __init__(self, settings: ServiceSettings) -> None:
        """Nothing is read from the provider yet, so that the service starts without it.

        Raises:
            InvalidInput: for an invalid or a missing setting, a proxy or certificates that cannot be used.
        """
        assert settings.oidc_issuer is not None
        self.issuer = settings.oidc_issuer
        if not _is_safe(self.issuer):
            raise InvalidInput("BENTRAY_OIDC_ISSUER", self.issuer, "an https address")
        if settings.oidc_client_id is None:
            raise InvalidInput("BENTRAY_OIDC_CLIENT_ID", "nothing", "the client id from the provider")
        self._client_id = settings.oidc_client_id
        self._secret = _secret(settings)
        self._scope = settings.oidc_scope
        # A proxy or certificates that cannot be used end the start of the service, not the first sign-in.
        proxy_for(httpx.URL(self.issuer))
        certificates()
        self._http = httpx.Client(timeout=PATIENCE_S, transport=Transport())
        self._lock = threading.Lock()
        self._read_at = self._keys_at = -FRESH_S
        self._document: dict[str, Any] = {}
        self._keys: KeySet | None = None

    def close(self) -> None:
        self._http.close()

    def authorization_url(self, redirect_uri: str, state: str, nonce: str, verifier: str) -> str:
        """Address of the provider at which the user signs in.

        Raises:
            ProviderUnavailable: when the discovery document cannot be read.
        """
        client = OAuth2Client(None, self._client_id, scope=self._scope, code_challenge_method="S256")
        url, _ = client.create_authorization_url(
            self._discovered()["authorization_endpoint"],
            state=state,
            code_verifier=verifier,
            redirect_uri=redirect_uri,
            nonce=nonce,
        )
        return str(url)

    def logout_url(self, back: str) -> str | None:
        """Address that ends the session at the provider and leads back; None if it offers none."""
        end = self._discovered().get("end_session_endpoint")
        query = [("client_id", self._client_id), ("post_logout_redirect_uri", back)]
        return None if end is None else add_params_to_uri(end, query)

    def claims(
        self, code: str, redirect_uri: str, nonce: str, verifier: str, names: tuple[str, ...]
    ) -> dict[str, Any]:
        """Exchange a code for the verified claims of the user.

        Args:
            code: from the response of the provider.
            redirect_uri, nonce, verifier: of the request.
            names: claims that are read from the user info endpoint if the ID token lacks one.

        Raises:
            NotAuthenticated: when the provider refuses the code, or its answer is not valid.
            ProviderUnavailable: when it does not answer.
        """
        document = self._discovered()
        form = {"code": code, "code_verifier": verifier}
        body = prepare_token_request("authorization_code", "", redirect_uri, **form)
        headers = {"Content-Type": "application/x-www-form-urlencoded"}
        authentication = self._authentication(document)
        address, headers, body = authentication.prepare("POST", document["token_endpoint"], headers, body)
        answer = self._fetch("POST", address, headers, content=body)
        if answer is None or not isinstance(answer.get("id_token"), str):
            raise NotAuthenticated("code", "one that the provider does not accept", "a new sign-in")
        claims = self._verified(answer["id_token"], nonce)
        address = document.get("userinfo_endpoint")
        missing = any(name.partition(".")[0] not in claims and name not in claims for name in names)
        if missing and address is not None and isinstance(answer.get("access_token"), str):
            more = self._fetch("GET", address, headers={"Authorization": f"Bearer {answer['access_token']}"})
            # OpenID Connect Core 5.3.2: else they may be those of another user.
            if more is None or more.get("sub") != claims["sub"]:
                raise NotAuthenticated("sub", "another user in the user info", "the user of the ID token")
            # An address and whether it is verified come from one source.
            pair = {} if {"email", "email_verified"} <= claims.keys() else {"email", "email_verified"}
            claims = {**more, **{name: value for name, value in claims.items() if name not in pair}}
        return claims

    def _authentication(self, document: Mapping[str, Any]) -> ClientAuth:
        """How this client authenticates at the token endpoint."""
        if self._secret is None:
            return ClientAuth(self._client_id, None, "none")
        methods = document.get("token_endpoint_auth_methods_supported", ["client_secret_basic"])
        if "client_secret_basic" in methods:
            # RFC 6749, 2.3.1: both are form-encoded first.
            return ClientAuth(quote_plus(self._client_id), quote_plus(self._secret), "client_secret_basic")
        return ClientAuth(self._client_id, self._secret, "client_secret_post")

    def _verified(self, token: str, nonce: str) -> dict[str, Any]:
        """The claims of an ID token, verified as in OpenID Connect Core 3.1.3.7."""
        rules: dict[str, Any] = {
            "iss": {"essential": True, "value": self.issuer},
            "sub": {"essential": True},
            "aud": {"essential": True, "value": self._client_id},
            "azp": {"value": self._client_id},
            "nonce": {"essential": True, "value": nonce},
        }
        try:
            try:
                decoded = jwt.decode(token, self._key_set(), algorithms=ALGORITHMS)
            except (InvalidKeyIdError, BadSignatureError):
                # The provider may have changed its keys.
                if not self._forget_keys():
                    raise
                decoded = jwt.decode(token, self._key_set(), algorithms=ALGORITHMS)
            claims = CodeIDToken(decoded.claims, decoded.header, rules, {"client_id": self._client_id})
            claims.validate(leeway=LEEWAY_S)
        except (JoseError, ValueError) as error:
            # The message of the library names the claim, not the token.
            raise NotAuthenticated("ID token", _words(error), "one signed for this sign-in") from error
        return dict(claims)

    def _discovered(self) -> dict[str, Any]:
        with self._lock:
            if time.monotonic() - self._read_at < FRESH_S:
                return self._document
            try:
                self._document = self._read_document()
                self._read_at = time.monotonic()
            except ProviderUnavailable:
                # An older document is better than none.
                if not self._document:
                    raise
            return self._document

    def _read_document(self) -> dict[str, Any]:
        found = self._fetch("GET", f"{self.issuer.rstrip('/')}/.well-known/openid-configuration")
        if found is None or found.get("issuer") != self.issuer:
            shown = "nothing" if found is None else repr(found.get("issuer"))[:120]
            raise ProviderUnavailable(f"a discovery document of the issuer {shown} in place of {self.issuer}")
        for name in (*NEEDED, *OPTIONAL):
            address = found.get(name)
            if address is None and name in OPTIONAL:
                continue
            if not (isinstance(address, str) and _is_safe(address)):
                raise ProviderUnavailable(f"a discovery document whose {name} is not an https address")
        return found

    def _key_set(self) -> KeySet:
        address = self._discovered()["jwks_uri"]
        with self._lock:
            if self._keys is None or time.monotonic() - self._keys_at >= FRESH_S:
                found = self._fetch("GET", address)
                try:
                    self._keys = KeySet.import_key_set(_signing(found))
                except (JoseError, KeyError, TypeError, ValueError) as error:
                    raise ProviderUnavailable("keys that cannot be read") from error
                self._keys_at = time.monotonic()
            return self._keys

    def _forget_keys(self) -> bool:
        """Read the keys again for the next token; not more often than every ``ROTATION_S``."""
        with self._lock:
            if time.monotonic() - self._keys_at < ROTATION_S:
                return False
            self._keys = None
            return True

    def _fetch(
        self, method: str, address: str, headers: Mapping[str, str] | None = None, **request: Any
    ) -> dict[str, Any] | None:
        """The JSON object at an address; None if the provider refuses. Redirects are not followed."""
        accept = {"Accept": "application/json", **(headers or {})}
        body = b""
        try:
            with self._http.stream(method, address, headers=accept, **request) as answer:
                for piece in answer.iter_bytes():
                    body += piece
                    if len(body) > MAX_BYTES:
                        raise ProviderUnavailable(f"an answer of more than {MAX_BYTES} bytes")
        except ProviderUnavailable:
            raise
        except (httpx.HTTPError, httpx.InvalidURL, InvalidInput) as error:
            # For the operator: users do not see proxies.
            proxy = through_proxy(error.request.url) if isinstance(error, httpx.TransportError) else ""
            log.warning("no answer from %s%s: %s", address, proxy, error)
            raise ProviderUnavailable(f"no answer ({type(error).__name__})") from error
        if answer.status_code >= httpx.codes.INTERNAL_SERVER_ERROR:
            raise ProviderUnavailable(f"status {answer.status_code}")
        if answer.status_code != httpx.codes.OK:
            # As {"error": "invalid_client"}, for the operator.
            log.warning("%s answered %d: %r", address, answer.status_code, body[:200])
            return None
        try:
            found = json.loads(body)
        except ValueError as error:
            raise ProviderUnavailable("an answer that is not JSON") from error
        return found if isinstance(found, dict) else None


def _signing(found: dict[str, Any] | None) -> Any:
    """The keys of a key set that sign; keys for encryption are left out."""
    keys = [] if found is None else found["keys"]
    return {"keys": [key for key in keys if key.get("use", "sig") == "sig"]}


def _secret(settings: ServiceSettings) -> str | None:
    path = settings.oidc_client_secret_file
    setting = "BENTRAY_OIDC_CLIENT_SECRET_FILE"
    return None if path is None else read_secret(path, setting).partition("\n")[0].strip()


def _is_safe(address: str) -> bool:
    """Whether an address is encrypted, or of this machine."""
    parts = urlsplit(address)
    return parts.scheme == "https" or (parts.scheme == "http" and names_loopback(parts.netloc))


def _words(error: Exception) -> str:
    """The fault of a token, in words."""
    if isinstance(error, ClaimError):
        return f"a wrong {error.claim}"
    return "an invalid signature" if isinstance(error, JoseError) else "an invalid one"


@dataclass(frozen=True)
class Identity:
    """A user as the service knows it."""

    tenant: Tenant
    who: str
    scopes: tuple[str, ...]


class ClaimMapping:
    """The rules of the settings from claims to an identity.

    Only the settings name tenants. A name in a claim has a tenant of its own, which never is that of a key.
    """

    def __init__(self, settings: ServiceSettings, claimed: ClaimedTenants) -> None:
        """Raises:
        InvalidInput: for an invalid tenant or scope in the settings.
        """
        self._claimed, self._issuer = claimed, settings.oidc_issuer or ""
        self._user = settings.oidc_user_claim
        self._tenant = settings.oidc_tenant_claim
        self._role = settings.oidc_role_claim
        self._tenants = {
            value: _checked("OIDC_TENANTS", checked_tenant, tenant)
            for value, tenant in (settings.oidc_tenants or {}).items()
        }
        self._roles = {
            value: _checked("OIDC_ROLES", checked_scopes, scopes)
            for value, scopes in (settings.oidc_roles or {}).items()
        }
        for name, table, claim in (
            ("TENANT", self._tenants, self._tenant),
            ("ROLE", self._roles, self._role),
        ):
            if table and claim is None:
                raise InvalidInput(f"BENTRAY_OIDC_{name}_CLAIM", "nothing", "the claim that the table reads")
        claimed.keep_from_claims([*self._tenants.values()])

    def names(self) -> tuple[str, ...]:
        """The claims that must be known."""
        used = [one for one in (self._user, self._tenant, self._role) if one is not None]
        return (*used, *(["email_verified"] if "email" in used else []))

    def identity(self, claims: Mapping[str, Any]) -> Identity:
        """The identity of a user.

        Args:
            claims: of the provider, verified.

        Raises:
            Forbidden: without a tenant or a role for the user.
        """
        users = values_of(claims, self._user)
        if len(users) != 1:
            raise Forbidden(
                self._user, _shown(users), "one name of the user: printable text, nothing around it"
            )
        # Longer ones are cut where they are stored, and could then be those of another user.
        if len(users[0]) > LONGEST_USER:
            raise Forbidden(self._user, f"{len(users[0])} characters", f"at most {LONGEST_USER}")
        verified = claims.get("email_verified")
        # Nothing else, also no text: whoever may write any address at the provider is not its owner.
        if "email" in (self._user, self._tenant, self._role) and verified is not True:
            found = repr(verified)[:40] if "email_verified" in claims else "nothing"
            raise Forbidden("email_verified", found, "true: an address that the provider has verified")
        return Identity(self._tenant_of(users[0], claims), users[0], self._scopes(claims))

    def _tenant_of(self, user: str, claims: Mapping[str, Any]) -> Tenant:
        if self._tenant is None:
            # Not by the claim that names the user: providers give names and addresses to others.
            subjects = values_of(claims, "sub")
            if len(subjects) != 1 or len(subjects[0]) > LONGEST_SUBJECT:
                raise Forbidden(
                    "sub", _shown(subjects), f"one subject, of at most {LONGEST_SUBJECT} characters"
                )
            return self._claimed.tenant(self._issuer, "sub", subjects[0], user)
        values = values_of(claims, self._tenant)
        if self._tenants:
            # The order of the settings decides, not that of the provider.
            for value, tenant in self._tenants.items():
                if value in values:
                    return tenant
            raise Forbidden(self._tenant, _shown(values), "a group that may use this service")
        if len(values) != 1 or len(values[0]) > LONGEST_USER:
            raise Forbidden(self._tenant, _shown(values), f"one tenant, of at most {LONGEST_USER} characters")
        return self._claimed.tenant(self._issuer, self._tenant, values[0], values[0])

    def _scopes(self, claims: Mapping[str, Any]) -> tuple[str, ...]:
        if not self._roles or self._role is None:
            return USUAL
        values = values_of(claims, self._role)
        scopes = [scope for value in values for scope in self._roles.get(value, ())]
        if not scopes:
            raise Forbidden(self._role, _shown(values), "a role that may use this service")
        return tuple(dict.fromkeys(scopes))


def values_of(claims: Mapping[str, Any], name: str) -> tuple[str, ...]:
    """The texts of a claim: one, or a list; a name with dots leads into nested claims.

    A claim whose own name has dots, as an address, comes first. Texts that are empty, or have space around or
    characters inside that are not shown, are left out: they would look like those of another user.
    """
    found: Any = claims.get(name)
    if found is None:
        found = claims
        for part in name.split("."):
            found = found.get(part) if isinstance(found, Mapping) else None
    if isinstance(found, str):
        found = [found]
    if not isinstance(found, list):
        return ()
    return tuple(
        one for one in found if isinstance(one, str) and one and one.isprintable() and one == one.strip()
    )


def _shown(values: tuple[str, ...]) -> str:
    return repr(", ".join(values))[:120] if values else "nothing"


def _checked(name: str, check: Callable[[str], Checked], text: str) -> Checked:
    try:
        return check(text)
    except InvalidInput as error:
        raise InvalidInput(f"BENTRAY_{name}", error.value, error.accepted) from None
