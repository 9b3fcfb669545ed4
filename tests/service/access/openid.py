"""An OpenID provider from the package index on a socket, which checks PKCE and can be made to lie."""

import base64
import hashlib
import json
import threading
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any
from urllib.parse import parse_qs, urlencode, urlsplit

import flask
import httpx
import werkzeug.serving
from joserfc.jwk import RSAKey

with warnings.catch_warnings():
    # It still imports the JOSE of Authlib, not that which Authlib itself now uses.
    warnings.simplefilter("ignore")
    from oidc_provider_mock import User, app

from .forged_tokens import Tamper, coded, compact


class TestProvider:
    """The provider.

    Attributes:
        issuer: its address.
        tamper: what happens to the next ID tokens.
        keys: published beside its own.
        requests: paths that were requested.
    """

    __test__ = False

    def __init__(self, users: dict[str, dict[str, Any]]) -> None:
        self.tamper: Tamper | None = None
        self.keys: list[dict[str, Any]] = []
        self.document: dict[str, Any] = {}
        self.user_info: dict[str, Any] = {}
        self.requests: list[str] = []
        self.down = False
        self._challenges: dict[str, str] = {}
        self.app = app(
            require_nonce=True, user_claims=[User(sub=sub, claims=user) for sub, user in users.items()]
        )
        self.app.before_request(self._before)
        self.app.after_request(self._after)
        self.http = httpx.Client()
        self._rotated: RSAKey | None = None
        self.issuer = ""

    def rotate(self) -> None:
        """Sign with a new key from now on."""
        self._rotated = RSAKey.generate_key(2048, {"kid": f"new-{len(self.requests)}"})

    def _before(self) -> Any:
        self.requests.append(flask.request.path)
        if self.down:
            return flask.Response("down", 503)
        if flask.request.path == "/oauth2/authorize":
            assert flask.request.args["code_challenge_method"] == "S256"
        if flask.request.path == "/oauth2/token":
            # The provider itself ignores PKCE.
            form = flask.request.form
            challenge = self._challenges.pop(form["code"], None)
            hashed = hashlib.sha256(form["code_verifier"].encode()).digest()
            if challenge != coded(hashed):
                return flask.Response('{"error": "invalid_grant"}', 400)
        return None

    def _after(self, answer: flask.Response) -> flask.Response:
        path = flask.request.path
        if path == "/oauth2/authorize" and answer.status_code == 302:
            query = parse_qs(urlsplit(answer.headers["Location"]).query)
            if "code" in query:
                self._challenges[query["code"][0]] = flask.request.args["code_challenge"]
            else:
                # RFC 6749, 4.1.2.1; it leaves the state out.
                answer.headers["Location"] += f"&{urlencode({'state': flask.request.args['state']})}"
        if answer.status_code != 200:
            return answer
        if path == "/.well-known/openid-configuration":
            answer.set_data(json.dumps({**answer.get_json(), **self.document}))
        if path == "/userinfo":
            answer.set_data(json.dumps({**answer.get_json(), **self.user_info}))
        if path == "/jwks":
            rotated = [] if self._rotated is None else [self._rotated.as_dict(private=False)]
            answer.set_data(json.dumps({"keys": [*self.keys, *(rotated or answer.get_json()["keys"])]}))
        if path == "/oauth2/token":
            answer.set_data(json.dumps(self._tampered(answer.get_json())))
        return answer

    def _tampered(self, answer: dict[str, Any]) -> dict[str, Any]:
        head, body, _ = answer["id_token"].split(".")
        header, claims = (json.loads(base64.urlsafe_b64decode(part + "===")) for part in (head, body))
        held = flask.g.oidc_provider_mock_storage.jwk
        # Of another library in the version for Python 3.11.
        own = held if isinstance(held, RSAKey) else RSAKey.import_key(held.as_dict(is_private=True))
        if self._rotated is not None:
            own, header["kid"] = self._rotated, self._rotated.kid
        token = self.tamper(claims, header, own) if self.tamper else None
        return {**answer, "id_token": compact(header, claims, own) if token is None else token}

    def authorize(self, address: str, user: str | None) -> str:
        """Sign a user in, or deny; returns the address to which the browser is sent."""
        form = {"action": "deny"} if user is None else {"sub": user}
        answer = self.http.post(address, data=form)
        assert answer.status_code == 302, answer.text
        return answer.headers["Location"]


@contextmanager
def providing(users: dict[str, dict[str, Any]]) -> Iterator[TestProvider]:
    """A provider on a free port of this machine."""
    made = TestProvider(users)
    server = werkzeug.serving.make_server("localhost", 0, made.app, threaded=True)
    made.issuer = f"http://localhost:{server.server_port}"
    thread = threading.Thread(target=server.serve_forever, args=(0.01,), daemon=True)
    thread.start()
    try:
        yield made
    finally:
        server.shutdown()
        thread.join()
        made.http.close()
        server.server_close()
