"""ID tokens to be refused (forged, unsigned, expired, foreign, malformed), and some to be accepted.

References: OpenID Connect Core 1.0, 2 and 3.1.3.7; RFC 7515, 4.1 and 10; RFC 7519, 4.1 and 7.2; RFC 8725.
"""

import base64
import hmac
import json
import time
from collections.abc import Callable, Mapping
from functools import cache
from typing import Any

from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import padding
from joserfc.jwk import ECKey, RSAKey

Claims = dict[str, Any]
# Changes claims and header of a token that the provider signs then, or returns another token.
Tamper = Callable[[Claims, Claims, RSAKey], str | None]

AUDIENCE, SECRET = "bentray", b"s3cret"
NOW, HOUR = time.time(), 3600


def coded(some: bytes) -> str:
    """Base64url without padding."""
    return base64.urlsafe_b64encode(some).rstrip(b"=").decode()


def compact(
    header: Mapping[str, Any], claims: Mapping[str, Any] | bytes, key: RSAKey, secret: bytes = b""
) -> str:
    """A token whose signature is what its header says; of none it is empty, of HS256 by the secret."""
    payload = claims if isinstance(claims, bytes) else json.dumps(claims).encode()
    signed = f"{coded(json.dumps(header).encode())}.{coded(payload)}"
    algorithm, data, made = header.get("alg"), signed.encode(), b""
    private, sha = key.private_key, hashes.SHA256()
    if algorithm == "RS256":
        made = private.sign(data, padding.PKCS1v15(), sha)
    elif algorithm == "PS256":
        made = private.sign(data, padding.PSS(padding.MGF1(sha), sha.digest_size), sha)
    elif str(algorithm).startswith("HS"):
        made = hmac.digest(secret, data, f"sha{algorithm[2:]}")
    return f"{signed}.{coded(made)}"


@cache
def another_key() -> RSAKey:
    return RSAKey.generate_key(2048, {"kid": "another"})


def edit(**values: Any) -> Tamper:
    """Other claims; those of value None are left out."""

    def tamper(claims: Claims, header: Claims, key: RSAKey) -> None:
        claims.update(values)
        for name in [name for name, value in values.items() if value is None]:
            del claims[name]

    return tamper


def head(**values: Any) -> Tamper:
    """Other parameters of the header, signed by the provider."""
    return lambda claims, header, key: header.update(values)


def payload(make: Callable[[Claims], bytes]) -> Tamper:
    """Other bytes in place of the claims, signed by the provider."""
    return lambda claims, header, key: compact(header, make(claims), key)


def forged(**values: Any) -> Tamper:
    """Signed by another key, with a header that names it."""
    return lambda claims, header, key: compact({**header, **values}, claims, another_key())


def unsigned(algorithm: Any) -> Tamper:
    return lambda claims, header, key: compact({**header, "alg": algorithm}, claims, key)


def shared(secret: Callable[[RSAKey], bytes], algorithm: str = "HS256") -> Tamper:
    """Signed with what everybody knows as a shared secret."""
    return lambda claims, header, key: compact({**header, "alg": algorithm}, claims, key, secret(key))


def changed(change: Callable[[str], Any]) -> Tamper:
    """A right token that is changed afterwards."""
    return lambda claims, header, key: change(compact(header, claims, key))


def _public(encoding: serialization.Encoding, form: serialization.PublicFormat) -> Callable[[RSAKey], bytes]:
    return lambda key: key.public_key.public_bytes(encoding, form)


def _other_claims(token: str) -> str:
    first, body, signature = token.split(".")
    claims = json.loads(base64.urlsafe_b64decode(body + "==="))
    return f"{first}.{coded(json.dumps({**claims, 'sub': 'bob'}).encode())}.{signature}"


def _twice(name: str, first: Any) -> Tamper:
    return payload(
        lambda claims: f'{{"{name}": {json.dumps(first)}, '.encode() + json.dumps(claims).encode()[1:]
    )


def _by_other_kind(claims: Claims, header: Claims, key: RSAKey) -> str:
    from joserfc import jwt

    return jwt.encode({**header, "alg": "ES256"}, claims, ECKey.generate_key("P-256"))


PEM, DER = serialization.Encoding.PEM, serialization.Encoding.DER
INFO, PKCS1 = serialization.PublicFormat.SubjectPublicKeyInfo, serialization.PublicFormat.PKCS1

FORGED: dict[str, Tamper] = {
    "another key": forged(),
    "another key without kid": lambda claims, header, key: compact({"alg": "RS256"}, claims, another_key()),
    "another key, PS256": forged(alg="PS256"),
    "a key of another kind": _by_other_kind,
    "unknown kid": forged(kid="unknown"),
    "kid that is a path": forged(kid="../../../../dev/null"),
    "kid that is a query": forged(kid="' OR '1'='1"),
    "kid that is no text": forged(kid=7),
    "its own key in jwk": lambda claims, header, key: compact(
        {**header, "jwk": another_key().as_dict(private=False)}, claims, another_key()
    ),
    "its own key at jku": forged(jku="http://evil.example/jwks"),
    "its own key at x5u": forged(x5u="http://evil.example/certificate.pem"),
    "its own key in x5c": forged(x5c=["MIIB"]),
    "claims of another user": changed(_other_claims),
    "no signature": changed(lambda token: token.rpartition(".")[0] + "."),
    "half a signature": changed(lambda token: token[:-100]),
    "a changed signature": changed(lambda token: token[:-20] + "A" * 20),
    "header parameter that must be understood": head(crit=["exp2"], exp2=1),
    "payload that is not encoded": head(crit=["b64"], b64=False),
    **{
        f"alg {alg}": unsigned(alg) for alg in ("none", "None", "NONE", "nOnE", "", None, 0, ["RS256"], "RS1")
    },
    **{
        f"{algorithm} by the public key, {name}": shared(secret, algorithm)
        for algorithm in ("HS256", "HS512")
        for name, secret in {
            "PEM": _public(PEM, INFO),
            "PEM PKCS 1": _public(PEM, PKCS1),
            "DER": _public(DER, INFO),
            "JWK": lambda key: json.dumps(key.as_dict(private=False)).encode(),
        }.items()
    },
    "HS256 by the client secret": shared(lambda key: SECRET),
    "HS256 by nothing": shared(lambda key: b""),
}
EXPIRED: dict[str, Tamper] = {
    "expired": edit(exp=NOW - HOUR),
    "expired long ago": edit(exp=0),
    "no exp": edit(exp=None),
    **{f"exp {end!r}": edit(exp=end) for end in ("9999999999", "", True, [9999999999], {}, float("nan"))},
    "exp Infinity": edit(exp=float("inf")),
    "not yet valid": edit(nbf=NOW + HOUR),
    "nbf that is no time": edit(nbf="now"),
    "from the future": edit(iat=NOW + HOUR),
    "no iat": edit(iat=None),
    "iat that is no time": edit(iat="now"),
}
FOREIGN: dict[str, Tamper] = {
    "issuer": edit(iss="http://evil.example"),
    "issuer with slash": lambda claims, header, key: claims.update(iss=claims["iss"] + "/"),
    "issuer in capitals": lambda claims, header, key: claims.update(iss=claims["iss"].upper()),
    "issuers": lambda claims, header, key: claims.update(iss=[claims["iss"], "http://evil.example"]),
    "no issuer": edit(iss=None),
    "audience": edit(aud="another client"),
    "audience in capitals": edit(aud="BENTRAY"),
    "audience with more": edit(aud="bentray another"),
    "no audience": edit(aud=None),
    "empty audience": edit(aud=""),
    "audiences without this": edit(aud=["another client"]),
    "no audiences": edit(aud=[]),
    "audiences without azp": edit(aud=[AUDIENCE, "another client"]),
    "audiences that are no texts": edit(aud=[AUDIENCE, 7], azp=AUDIENCE),
    "audience that is no text": edit(aud={AUDIENCE: True}),
    "azp": edit(azp="another client"),
    "azp of audiences": edit(aud=[AUDIENCE, "another client"], azp="another client"),
    "azp that is no text": edit(azp=[AUDIENCE]),
    "nonce": edit(nonce="another"),
    "no nonce": edit(nonce=None),
    "empty nonce": edit(nonce=""),
    "nonce that is no text": edit(nonce=7),
    "no subject": edit(sub=None),
    "empty subject": edit(sub=""),
    "subject that is no text": edit(sub=7),
    "subjects": edit(sub=["alice"]),
}
MALFORMED: dict[str, Tamper] = {
    "a number": changed(lambda token: 7),
    "object": changed(lambda token: {"token": token}),
    "empty": changed(lambda token: ""),
    "two parts": changed(lambda token: token.rpartition(".")[0]),
    "four parts": changed(lambda token: token + ".e30"),
    "encrypted": changed(lambda token: coded(b'{"alg": "dir", "enc": "A128GCM"}') + "..AA.AA.AA"),
    "in JSON": changed(
        lambda token: json.dumps(
            dict(zip(("protected", "payload", "signature"), token.split("."), strict=True))
        )
    ),
    "not encoded": changed(lambda token: f"!{token}"),
    "claims that are a list": payload(lambda claims: b"[]"),
    "claims that are no JSON": payload(lambda claims: b"claims"),
    "claims that are nothing": payload(lambda claims: b""),
    "claims of great depth": payload(lambda claims: b'{"a":' * 20_000 + b"1" + b"}" * 20_000),
}
# Another answer than 401, since the provider itself does not work.
TOO_LARGE = payload(lambda claims: json.dumps({**claims, "more": "x" * (1 << 21)}).encode())
ACCEPTED: dict[str, Tamper] = {
    "PS256": lambda claims, header, key: compact({**header, "alg": "PS256"}, claims, key),
    "audiences with azp": edit(aud=[AUDIENCE, "another client"], azp=AUDIENCE),
    "one audience in a list": edit(aud=[AUDIENCE]),
    "clocks that differ by half a minute": edit(iat=NOW + 30, nbf=NOW + 30),
    "claims that nobody needs": edit(acr="1", amr=["pwd"], auth_time=1, jti="7", more={"a": [None]}),
    "no kid, of one key": lambda claims, header, key: compact({"alg": "RS256"}, claims, key),
    # RFC 7519, 4: the last counts.
    "subject of another claim of this name": _twice("sub", "bob"),
    "issuer of another claim of this name": _twice("iss", "http://evil.example"),
    "a key set elsewhere, which is not read": head(
        jku="http://evil.example/jwks", x5u="http://evil.example/x"
    ),
}
