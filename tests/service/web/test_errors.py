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


def test_invalid_input_names_field_found_accepted(http):
    answer = http.get("/refused")
    assert answer.headers["content-type"] == "application/problem+json"
    assert answer.json() == {
        "type": "/problems/invalid-input",
        "title": "Invalid value",
        "status": 422,
        "detail": "speed: found -1; accepted: a speed > 0",
        "instance": "/refused",
        "field": "speed",
        "found": "-1",
        "accepted": "a speed > 0",
    }


def test_a_refusal_has_the_status_of_the_table(http):
    answer = http.get("/full")
    assert (answer.status_code, answer.json()["type"]) == (507, "/problems/storage-full")


def test_every_wrong_parameter_is_listed(http):
    body = http.get("/number?n=many").json()
    assert (body["status"], body["type"]) == (422, "/problems/invalid-request")
    assert [error["field"] for error in body["errors"]] == ["n", "m"]
    assert body["errors"][0]["found"] == "'many'"
    assert "integer" in body["errors"][0]["accepted"]
    assert body["errors"][1] == {"field": "m", "found": "nothing", "accepted": "a value; it is required"}


def test_router_errors_are_problems_too(http):
    missing, wrong = http.get("/nowhere"), http.put("/refused")
    assert (missing.status_code, missing.json()["type"]) == (404, "/problems/not-found")
    assert (wrong.status_code, wrong.json()["type"]) == (405, "/problems/method-not-allowed")
    assert wrong.headers["allow"] == "GET, POST"
    assert "accepted: GET, POST" in wrong.json()["detail"]
    for method in ("OPTIONS", "TRACE", "PROPFIND"):
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


@pytest.mark.parametrize("body", [b"\xff", b"[" * 50_000, b"9" * 5000], ids=["bytes", "nesting", "digits"])
def test_a_body_that_is_no_readable_json_is_named(http, body):
    answer = http.post("/refused", content=body, headers={"Content-Type": "application/json"})
    assert (answer.status_code, answer.json()["type"]) == (400, "/problems/unreadable-body")
    assert (answer.json()["field"], answer.json()["found"]) == ("body", "unreadable JSON")


@pytest.mark.parametrize("body", [b"[]", b"null", b'"x"'])
def test_wrong_body_type_names_json_types(http, body):
    answer = http.post("/refused", content=body, headers={"Content-Type": "application/json"})
    assert answer.status_code == 422
    assert answer.json()["field"] == "body"


def test_half_characters_do_not_break_the_answer(http):
    answer = http.get("/half")
    assert answer.status_code == 422
    assert answer.json()["field"] == "?"


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
