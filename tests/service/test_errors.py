"""Errors: every one is problem+json, and a surprise tells the log more than the client."""

import logging
import re

import pytest
from fastapi import FastAPI
from fastapi.testclient import TestClient

from bentray_kernels.errors import InvalidInput
from bentray_service import errors, refusals


@pytest.fixture
def http():
    app = FastAPI()
    errors.install(app)

    @app.get("/refused")
    def refused():
        raise InvalidInput("speed", -1, "a speed > 0")

    @app.get("/full")
    def full():
        raise refusals.StorageFull("body", "no space", "less")

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
        "title": "A value cannot be used",
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
    assert [one["field"] for one in body["errors"]] == ["n", "m"]
    assert body["errors"][0]["found"] == "'many'"
    assert "integer" in body["errors"][0]["accepted"]
    assert body["errors"][1] == {"field": "m", "found": "nothing", "accepted": "a value; it is required"}


def test_router_errors_are_problems_too(http):
    missing, wrong = http.get("/nowhere"), http.post("/refused")
    assert (missing.status_code, missing.json()["type"]) == (404, "/problems/not-found")
    assert (wrong.status_code, wrong.json()["type"]) == (405, "/problems/method-not-allowed")
    assert wrong.headers["allow"] == "GET"
    assert "accepted: GET" in wrong.json()["detail"]


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
