"""Every route and verb of the OpenAPI description: closed to strangers, other tenants and invented paths.

Nothing is listed by hand: a route that is new is tried too, and one whose ids or headers nothing here knows
fails by name.
"""

import asyncio
import base64
import json
import re
import sqlite3
from collections.abc import Iterator, Mapping
from contextlib import closing
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from fastapi import FastAPI
from fastapi.testclient import TestClient
from sqlalchemy import insert

from bentray_kernels.tomography.result import Reconstruction
from bentray_kernels.tomography.settings import Settings
from bentray_service.app import create_app
from bentray_service.routes.models.surface_records import FieldErrors, FieldSeconds, FieldSizes, Repairs
from bentray_service.rows.ids import Tenant, new_id, volume_of
from bentray_service.rows.jobs import NewJob, Submission
from bentray_service.rows.keys import ApiKey, Keys
from bentray_service.rows.tables import Base, FieldRow, ResultVolumeRow
from bentray_service.settings import ServiceSettings
from bentray_service.web import errors
from bentray_workers.files.reconstruction import write_reconstruction

from ...effort import effort
from ..conftest import FakeCluster

ACME, OTHER = Tenant("acme"), Tenant("other")
VERBS = errors.METHODS
# What a header that is required holds.
REQUIRED = {"tus-resumable": "1.0.0", "upload-offset": "0", "upload-length": "4"}
# Texts that mean nothing to the service, so that anything may be in them.
FREE = {"title", "name", "notes", "text", "idempotency-key", "upload-metadata"}
HOSTILE = ("..%2f..%2foutside", "../../../outside", "/etc/passwd\x00")


class Place(NamedTuple):
    """A running application, its folder, what two tenants have, and headers by who sends them."""

    http: TestClient
    folder: Path
    ids: dict[str, str]
    auth: dict[str, dict[str, str]]


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Place]:
    """One service for all tests: tenant acme has one of everything, tenant other nothing."""
    folder = tmp_path_factory.mktemp("access")
    # Jobs stay where they are: no disk has so much room.
    settings = ServiceSettings(
        data_dir=folder / "data", min_free_bytes=2**60, requests_per_minute=0, renders_per_minute=0
    )
    app = create_app(settings, FakeCluster())
    with TestClient(app, base_url="http://localhost", raise_server_exceptions=False) as http:
        state = app.state
        keys = Keys(state.stores.database)
        auth: dict[str, dict[str, str]] = {}
        for name, tenant, scopes in (
            ("acme", ACME, ("read", "write")),
            ("reader", ACME, ("read",)),
            ("writer", ACME, ("write",)),
            ("metrics", ACME, ("metrics",)),
            ("other", OTHER, ("read", "write")),
        ):
            token = ApiKey.new()
            keys.add(token, tenant, name, scopes)
            auth[name] = {"Authorization": f"Bearer {token.shown()}"}
        project = http.post("/v1/projects", json={"name": "One"}, headers=auth["acme"]).json()["id"]
        yield Place(http, folder, {**one_of_each(app, http, ACME, auth["acme"]), "project_id": project}, auth)


def one_of_each(app: FastAPI, http: TestClient, owner: Tenant, auth: dict[str, str]) -> dict[str, str]:
    """One of everything of a tenant or a project, by the name that paths give its id."""
    state = app.state
    files = state.stores.files.of(owner)
    dataset, mesh, field = new_id("dataset"), new_id("mesh"), new_id("field")
    scan = dict.fromkeys(("dimension", "elements", "ntx", "nrx", "slices", "water_speed_mps"), 0)
    scan |= dict.fromkeys(("title", "source", "license"), "")
    scan |= dict.fromkeys(("has_traces", "has_travel_times", "has_truth"), False)
    state.stores.datasets.add(owner, dataset, size=1, sha256="0" * 64, summary=scan)
    surface = {"vertices": 4, "faces": 4, "genus": 0, "holes": 0, "coloured": False}
    surface["repairs"] = dict.fromkeys(Repairs.model_fields, 0)
    surface |= {"title": "", "format": "ply", "content": "0" * 64}
    state.stores.meshes.add(owner, mesh, size=1, sha256="0" * 64, summary=surface)
    job = state.stores.jobs.add(owner, NewJob("reconstruction", {}, dataset)).id
    cube = {"axes": "x,y,z", "shape": [4, 4, 4], "spacing_m": [1.0] * 3, "origin_m": [0.0] * 3}
    cube |= {"speed_range_mps": [1.0, 2.0], "water_speed_mps": 1.0, "provenance": {}, "bytes": 1}
    # At its end, so that its events have one too.
    state.stores.jobs.request_cancel(owner, job)
    batch = state.stores.batches.add(owner, "", {}, [NewJob("reconstruction", {}, dataset)], Submission()).id
    state.stores.batches.request_cancel(owner, batch)
    figures = dict.fromkeys((*FieldSizes.model_fields, *FieldErrors.model_fields), 1)
    figures |= {f"{name}_seconds": 1.0 for name in FieldSeconds.model_fields}
    with state.stores.database.write() as connection:
        made = {"tenant": owner, "job_id": job, "created": 1.0}
        connection.execute(insert(ResultVolumeRow).values(id=volume_of(job), **made, **cube))
        made |= {"mesh_id": mesh, "bytes": 1, "settings": {}, "figures": figures}
        connection.execute(insert(FieldRow).values(id=field, **made))
    for path in (files.dataset(dataset), files.mesh(mesh)):
        path.write_bytes(b"of acme")
    ones = np.ones((4, 4, 4))
    result = Reconstruction(ones, ones, (1.0,) * 3, (0.0,) * 3, 1.0, Settings(method="sart"))
    write_reconstruction(files.volume(volume_of(job)), result)
    name = base64.b64encode(b"dataset").decode()
    begun = http.post(
        "/v1/uploads",
        headers={**auth, "Tus-Resumable": "1.0.0", "Upload-Length": "9", "Upload-Metadata": f"kind {name}"},
    )
    assert begun.status_code == 201, begun.text
    return {
        "dataset_id": dataset,
        "mesh_id": mesh,
        "job_id": job,
        "batch_id": batch,
        "volume_id": volume_of(job),
        "field_id": field,
        "upload_id": begun.headers["location"].rpartition("/")[2],
    }


class Asked(NamedTuple):
    """One operation of the description."""

    verb: str
    path: str
    what: Mapping[str, Any]

    def parameters(self, where: str) -> list[Mapping[str, Any]]:
        return [one for one in self.what.get("parameters", []) if one["in"] == where]

    def headers(self) -> dict[str, str]:
        """Those that it needs beside the key."""
        needed = [one["name"].lower() for one in self.parameters("header") if one.get("required")]
        body = self.what.get("requestBody")
        media = {"content-type": next(iter(body["content"]))} if body else {}
        return {**{name: REQUIRED[name] for name in needed}, **media}


def operations(place: Place) -> list[Asked]:
    document = place.http.app.openapi()
    return [
        Asked(verb.upper(), path, what)
        for path, verbs in document["paths"].items()
        for verb, what in verbs.items()
    ]


def filled(path: str, ids: Mapping[str, str]) -> str:
    return re.sub(r"\{(\w+)\}", lambda found: ids[found[1]], path)


def unread(app: FastAPI, verb: str, path: str, headers: Mapping[str, str]) -> tuple[int, dict[str, Any]]:
    """Status and body of an answer that is given without a byte of the request's body being read."""
    sent: list[Any] = []

    async def receive() -> Any:
        raise AssertionError(f"{verb} {path} read of the body")

    async def send(message: Any) -> None:
        sent.append(message)

    given = {"host": "localhost", "content-length": "999999", **headers}
    scope = {
        "type": "http",
        "asgi": {"version": "3.0"},
        "http_version": "1.1",
        "method": verb,
        "scheme": "http",
        "path": path,
        "raw_path": path.encode(),
        "query_string": b"",
        "headers": [(name.lower().encode(), value.encode()) for name, value in given.items()],
        "client": ("127.0.0.1", 1),
        "server": ("localhost", 80),
    }
    asyncio.run(app(scope, receive, send))
    body = b"".join(message.get("body", b"") for message in sent)
    return sent[0]["status"], json.loads(body) if body else {}


def stored(place: Place, beside: str = "") -> dict[str, Any]:
    """Every file but the record of who asked, and every row but when keys were used."""
    found: dict[str, Any] = {
        str(path.relative_to(place.folder)): path.stat().st_size
        for path in place.folder.rglob("*")
        if path.is_file() and path.parent.name != "audit" and not path.name.startswith("bentray.sqlite")
    }
    with closing(sqlite3.connect(place.folder / "data" / "bentray.sqlite")) as rows:
        for table in Base.metadata.tables:
            if table not in ("keys", "about"):
                found[table] = rows.execute(f"SELECT * FROM {table} ORDER BY 1").fetchall()
    return {name: value for name, value in found.items() if not beside or not name.startswith(beside)}


def single(routes: list[Any]) -> Iterator[Any]:
    """Every route, also of routers that are in others."""
    for route in routes:
        inner = getattr(route, "original_router", None)
        yield from [route] if inner is None else single(inner.routes)


def test_everything_is_described(place: Place) -> None:
    """Guards these tests: what the application routes and does not describe is a page or a HEAD."""
    known = {asked.path for asked in operations(place)}
    paths = {route.path for route in single(place.http.app.routes)}
    # A router in another one does not know the beginning of its paths.
    hidden = {path for path in paths if not any(one.endswith(path) for one in known)}
    pages = {
        "/",
        "/docs",
        "/docs/formats",
        "/documentation",
        "/documentation/{path:path}",
        "/problems/{slug}",
        "/static/export_formats.json",
    }
    sign_in = {"/sign-in", "/sign-in/callback", "/sign-in/provider", "/sign-out"}
    assert hidden <= pages | sign_in | {"/openapi.json", "/static"}
    assert len(known) > 20


def test_unauthenticated_requests_are_rejected_unread(place: Place) -> None:
    before, public = stored(place), set()
    invented = {"Authorization": f"Bearer {ApiKey.new().shown()}"}
    garbled = {"Authorization": "Bearer bentray_é"}
    for path in {*(asked.path for asked in operations(place)), "/v1/nowhere", "/nowhere", "//v1/jobs"}:
        if path.startswith("/health/"):
            public.add(path)
            continue
        for verb in VERBS:
            here = filled(path, place.ids)
            # Whatever the verb, the key is looked at in one place.
            others = (invented, garbled, {"Authorization": "Basic YTpi"}) if verb == "GET" else ()
            for auth in ({}, *others):
                status, problem = unread(place.http.app, verb, here, auth)
                assert (status, problem.get("type")) == (401, "/problems/not-let-in"), (verb, here, auth)
                assert not re.search("é|YTpi", str(problem))
    assert public == {"/health/live", "/health/ready"}
    assert stored(place) == before


PACKED = [
    *(
        {"content-encoding": one}
        for one in ("gzip", "GZIP", "x-gzip", "deflate", "br", "zstd", "identity, br")
    ),
    *({"content-encoding": one} for one in ("gzip, gzip", "compress", "aes128gcm", "nonsense")),
    {"transfer-encoding": "gzip, chunked"},
    {"transfer-encoding": "chunked", "content-encoding": "gzip"},
]


def test_packed_bodies_are_refused_unread(place: Place) -> None:
    taking = [asked for asked in operations(place) if "requestBody" in asked.what]
    assert {"PATCH", "POST", "PUT"} == {asked.verb for asked in taking}
    for asked, packed in product(taking, PACKED):
        headers = {**asked.headers(), **place.auth["acme"], **packed}
        status, problem = unread(place.http.app, asked.verb, filled(asked.path, place.ids), headers)
        assert (status, problem["field"].lower()) == (415, [*packed][-1]), (asked.verb, asked.path, packed)
        assert "without packing" in problem["detail"]


@pytest.mark.parametrize(
    ("method", "coding", "status"),
    [("POST", "Gzip", 415), ("POST", "identity", 422), ("POST", "", 422), ("GET", "gzip", 405)],
)
def test_what_coding_is_accepted_is_said(place: Place, method: str, coding: str, status: int) -> None:
    headers = {**place.auth["acme"], "Content-Type": "application/json", "Content-Encoding": coding}
    content = None if method == "GET" else b"{}"
    answer = place.http.request(method, "/v1/plans", content=content, headers=headers)
    assert answer.status_code == status
    assert answer.headers.get("accept-encoding") == ("identity" if status == 415 else None)


def test_objects_of_other_tenants_are_not_found(place: Place) -> None:
    before, tried = stored(place), 0
    for asked in operations(place):
        if "{" not in asked.path or not asked.path.startswith("/v1/"):
            continue
        here = filled(asked.path, place.ids)
        verbs = (asked.verb, "HEAD") if asked.verb == "GET" else (asked.verb,)
        for verb in verbs:
            owner = place.http.request(verb, here, headers=place.auth["acme"]) if verb == "GET" else None
            # What HEAD needs is not described.
            needed = REQUIRED if verb == "HEAD" else asked.headers()
            headers, content = {**needed, **place.auth["other"]}, b"x"
            taken = asked.what.get("requestBody", {}).get("content", {}).get("application/json")
            if taken is not None:
                content = json.dumps(next(iter(taken["examples"].values()))["value"]).encode()
            theirs = place.http.request(verb, here, headers=headers, content=content)
            # A path without HEAD has none for anybody.
            expected = (404, 405) if verb == "HEAD" else (404,)
            assert theirs.status_code in expected, (verb, here, theirs.text)
            if verb == "HEAD":
                continue
            assert theirs.json()["type"] == "/problems/unknown-id", (verb, here)
            nothing = filled(asked.path, {name: f"{one[:-20]}{'0' * 20}" for name, one in place.ids.items()})
            unknown = place.http.request(verb, nothing, headers=headers, content=content)
            assert alike(theirs.text) == alike(unknown.text)
            if owner is not None:
                assert "unknown-id" not in owner.text, here
            tried += 1
    assert tried > 15
    after = stored(place)
    # The owner's own reads note the checksums of what was there before there were any.
    assert {tenant for tenant, *_ in after.pop("checksums")} <= {"acme"}
    assert before.pop("checksums") == []
    assert after == before


def alike(text: str) -> str:
    """An answer without the ids in it."""
    return re.sub(r"[0-9a-f]{20}", "…", text)


def test_lists_contain_only_the_tenants_objects(place: Place) -> None:
    shown = set()
    for asked in operations(place):
        if asked.verb != "GET" or "{" in asked.path or not asked.path.startswith("/v1/"):
            continue
        # A stream of events ends by itself, but late.
        short = {"seconds": 1} if "text/event-stream" in asked.what["responses"]["200"]["content"] else {}
        mine = place.http.get(asked.path, params=short, headers=place.auth["acme"])
        theirs = place.http.get(asked.path, params=short, headers=place.auth["other"])
        assert (mine.status_code, theirs.status_code) == (200, 200), asked.path
        shown |= {name for name, one in place.ids.items() if one in mine.text}
        assert not [name for name, one in place.ids.items() if one in theirs.text], asked.path
    assert shown >= {"dataset_id", "mesh_id", "job_id", "volume_id", "field_id"}


def test_ids_in_bodies_and_queries_too(place: Place) -> None:
    before = stored(place)
    for kind, name, key in (
        ("reconstruction", "dataset", "dataset_id"),
        ("refraction", "volume", "volume_id"),
        ("geometry-field", "mesh", "mesh_id"),
    ):
        asked = {"kind": kind, name: place.ids[key]}
        answer = place.http.post("/v1/jobs", json=asked, headers=place.auth["other"])
        assert (answer.status_code, answer.json()["field"]) == (404, name)
    answer = place.http.get("/v1/jobs", params={"before": place.ids["job_id"]}, headers=place.auth["other"])
    assert answer.status_code == 404
    assert stored(place) == before


def test_key_scopes_limit_routes(place: Place) -> None:
    before = stored(place)
    for asked in operations(place):
        here = filled(asked.path, place.ids)
        if asked.path.startswith("/health/"):
            continue
        needed = (
            "metrics" if here == "/metrics" else "reader" if asked.verb in ("GET", "OPTIONS") else "writer"
        )
        for name in {"reader", "writer", "metrics"} - {needed}:
            status, problem = unread(place.http.app, asked.verb, here, place.auth[name])
            assert (status, problem["type"]) == (403, "/problems/not-allowed"), (asked.verb, here, name)
    assert place.http.get("/metrics", headers=place.auth["metrics"]).status_code == 200
    assert place.http.get("/v1/datasets", headers=place.auth["reader"]).status_code == 200
    assert stored(place) == before


def test_no_string_leads_anywhere(place: Place) -> None:
    """In every path, query, header and field of JSON that takes a string."""
    mine = "data/tenants/acme/"
    tried = set()
    (place.folder / "outside").write_text("not theirs")
    before = stored(place, mine)
    for asked in operations(place):
        if asked.path.startswith("/health/") or asked.path == "/metrics":
            continue
        for where, name, hostile in strings(place, asked):
            headers = {**asked.headers(), **place.auth["acme"]}
            ids, query, body = dict(place.ids), {}, b"x"
            if where == "path":
                ids[name] = hostile.replace("\x00", "%00")
            elif where == "query":
                query[name] = hostile
            elif where == "header":
                headers[name] = hostile.replace("\x00", "")
            else:
                body = json.dumps(within(name.split("."), hostile, place.ids)).encode()
            answer = place.http.request(
                asked.verb, filled(asked.path, ids), params=query, headers=headers, content=body
            )
            refused = 400 <= answer.status_code < 500 or name in FREE
            assert refused, (asked.verb, asked.path, where, name, hostile, answer.status_code, answer.text)
            assert not re.search("root:|not theirs", answer.text)
            tried.add((where, name))
    assert {where for where, _ in tried} == {"path", "query", "header", "body"}
    after = {name: value for name, value in stored(place, mine).items() if "/" in name or name == "outside"}
    assert after == {name: value for name, value in before.items() if "/" in name or name == "outside"}
    for path in (place.folder / "data" / "tenants").rglob("*"):
        assert path.is_dir() or re.fullmatch(r"[a-z]+-[0-9a-f]{20}\.\w+", path.name), path


def strings(place: Place, asked: Asked) -> Iterator[tuple[str, str, str]]:
    """Where, its name, and what is put there."""
    for hostile in HOSTILE[: effort(1, len(HOSTILE))]:
        for one in asked.what.get("parameters", []):
            if "string" in json.dumps(one["schema"]):
                name = one["name"] if one["in"] == "path" else one["name"].lower()
                yield one["in"], name, hostile
        body = asked.what.get("requestBody", {}).get("content", {}).get("application/json")
        if body is None:
            continue
        known = place.http.app.openapi()["components"]["schemas"]
        if "oneOf" not in body["schema"]:
            model = known[body["schema"]["$ref"].rpartition("/")[2]]
            yield from (("body", name, hostile) for name in model["properties"])
            continue
        for choice in body["schema"]["oneOf"]:
            model = known[choice["$ref"].rpartition("/")[2]]
            kind = model["properties"]["kind"]["const"]
            for name, one in model["properties"].items():
                if "$ref" not in json.dumps(one):
                    yield "body", f"{kind}.{name}", hostile
                    continue
                inner = known[re.search(r"schemas/(\w+)", json.dumps(one))[1]]["properties"]
                yield from (("body", f"{kind}.{name}.{field}", hostile) for field in inner)


def within(names: list[str], value: str, ids: Mapping[str, str]) -> dict[str, Any]:
    """A job request of a kind with a value somewhere in it, or a record of one field."""
    kind, *rest = names
    if not rest:
        return {kind: value}
    read = {"reconstruction": "dataset", "refraction": "volume", "geometry-field": "mesh"}.get(kind)
    asked: dict[str, Any] = {"kind": kind} | ({read: ids[f"{read}_id"]} if read else {})
    if len(rest) == 1:
        return {**asked, rest[0]: value}
    return {**asked, rest[0]: {rest[1]: value}}
