"""Errors: every one is problem+json; unexpected ones are logged in full."""

import logging
import re

import pytest
from fastapi import APIRouter, FastAPI
from fastapi.staticfiles import StaticFiles
from fastapi.testclient import TestClient
from starlette.requests import ClientDisconnect

from bentray_kernels.errors import InvalidInput
from bentray_service.errors import StorageFull
from bentray_service.web import errors


@pytest.fixture
def http():
    app = FastAPI()
    errors.install_handlers(app)

    @app.get("/refused")
    def problem_response():
        raise InvalidInput("speed", -1, "a speed > 0")

    @app.get("/full")
    def full():
        raise StorageFull("body", "no space", "less")

    @app.post("/refused")
    def sent(body: dict[str, int]):
        return body

    @app.get("/half")
    def half():
        raise InvalidInput("\ud800", 1, "a whole character")

    @app.get("/gone")
    def gone():
        raise ClientDisconnect

    @app.get("/bug")
    def bug():
        raise RuntimeError("the secret inside")

    @app.get("/number")
    def number(n: int, m: int):
        return n + m

    return TestClient(app, raise_server_exceptions=False)


SPEED = {
    "type": "/problems/invalid-input",
    "title": "Invalid value",
    "status": 422,
    "detail": "speed: found -1; accepted: a speed > 0",
    "instance": "/refused",
    "field": "speed",
    "found": "-1",
    "accepted": "a speed > 0",
}
UNREADABLE = {"type": "/problems/unreadable-body", "field": "body", "found": "unreadable JSON"}
# Method and address, body, status, and what the problem says.
CASES = {
    "refused": ("GET /refused", None, 422, SPEED),
    "table": ("GET /full", None, 507, {"type": "/problems/storage-full"}),
    "half a character": ("GET /half", None, 422, {"field": "?"}),
    "unknown": ("GET /nowhere", None, 404, {"type": "/problems/not-found"}),
    "method": ("PUT /refused", None, 405, {"type": "/problems/method-not-allowed"}),
    "bytes": ("POST /refused", b"\xff", 400, UNREADABLE),
    "nesting": ("POST /refused", b"[" * 50_000, 400, UNREADABLE),
    "digits": ("POST /refused", b"9" * 5000, 400, UNREADABLE),
    "list": ("POST /refused", b"[]", 422, {"field": "body"}),
    "null": ("POST /refused", b"null", 422, {"field": "body"}),
    "text": ("POST /refused", b'"x"', 422, {"field": "body"}),
}


@pytest.mark.parametrize(("request_line", "body", "status", "problem"), CASES.values(), ids=CASES)
def test_errors_are_problems(http, request_line, body, status, problem):
    headers = {"Content-Type": "application/json"}
    answer = http.request(*request_line.split(), content=body, headers=headers)
    assert (answer.status_code, answer.headers["content-type"]) == (status, "application/problem+json")
    assert answer.json() | problem == answer.json()


def test_every_wrong_parameter_is_listed(http):
    body = http.get("/number?n=many").json()
    assert (body["status"], body["type"]) == (422, "/problems/invalid-request")
    assert [error["field"] for error in body["errors"]] == ["n", "m"]
    assert body["errors"][0]["found"] == "'many'"
    assert "integer" in body["errors"][0]["accepted"]
    assert body["errors"][1] == {"field": "m", "found": "nothing", "accepted": "a value; it is required"}


def test_a_wrong_method_names_the_others(http):
    assert "accepted: GET, POST" in http.put("/refused").json()["detail"]
    for method in ("PUT", "OPTIONS", "TRACE", "PROPFIND"):
        answer = http.request(method, "/refused")
        assert (answer.status_code, answer.headers["allow"]) == (405, "GET, POST"), method


def test_allow_header_lists_methods_of_all_routes(tmp_path):
    router = APIRouter(prefix="/v1")

    @router.head("/things/{name}")
    @router.get("/things/{name}")
    def thing(name: str):
        return name

    @router.post("/things/{name}")
    def change(name: str):
        return name

    app = FastAPI()
    errors.install_handlers(app)
    app.include_router(router)
    app.mount("/static", StaticFiles(directory=tmp_path))
    http = TestClient(app)
    for address, allowed in (("/v1/things/one", "GET, HEAD, POST"), ("/static/app.js", "GET, HEAD")):
        answer = http.delete(address)
        assert (answer.status_code, answer.headers["allow"]) == (405, allowed)
        assert answer.json()["detail"].endswith(f"accepted: {allowed}")


def test_a_client_that_leaves_is_no_error_of_the_service(http, caplog):
    with caplog.at_level(logging.WARNING, "bentray.errors"):
        http.get("/gone")
    assert caplog.records == []


def test_a_surprise_stays_in_the_log(http, caplog):
    with caplog.at_level(logging.ERROR, "bentray.errors"):
        answer = http.get("/bug")
    body = answer.json()
    assert (answer.status_code, body["type"]) == (500, "/problems/internal")
    assert "secret" not in answer.text
    assert "Traceback" not in answer.text
    assert re.fullmatch("[0-9a-f]{16}", body["correlation_id"])
    assert body["correlation_id"] in caplog.text
    assert "the secret inside" in caplog.text
