"""Projects: only members see anything of one, on every route; roles; and requests of removed members end."""

import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from fastapi.testclient import TestClient

from bentray_service.access import key_watch
from bentray_service.access.audit import entries
from bentray_service.app import create_app
from bentray_service.client import Client
from bentray_service.rows.ids import Tenant
from bentray_service.rows.keys import ApiKey, Keys
from bentray_service.settings import ServiceSettings

from ..conftest import FakeCluster
from .test_every_route import Place, filled, one_of_each, operations

LAB = Tenant("lab")


class World(NamedTuple):
    """A tenant with a project that has one of everything, and another one that has nothing."""

    place: Place
    project: str
    headers: dict[str, dict[str, str]]
    keys: dict[str, str]

    def ask(self, who: str, verb: str, path: str, **how: Any) -> Any:
        headers = {**self.headers[who], **how.pop("headers", {})}
        return self.place.http.request(verb, path, headers=headers, **how)


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> Iterator[World]:
    folder = tmp_path_factory.mktemp("projects")
    settings = ServiceSettings(data_dir=folder / "data", min_free_bytes=2**60, requests_per_minute=0)
    app = create_app(settings, FakeCluster())
    with TestClient(app, base_url="http://localhost", raise_server_exceptions=False) as http:
        auth, keys = {}, {}
        for name in ("owner", "contributor", "reader", "outsider"):
            token = ApiKey.new()
            Keys(app.state.stores.database).add(token, LAB, name, ("read", "write"))
            auth[name], keys[name] = {"Authorization": f"Bearer {token.shown()}"}, f"key:{token.id}"
        made = [
            http.post("/v1/projects", json={"name": name}, headers=auth[who]).json()["id"]
            for name, who in (("One", "owner"), ("Two", "outsider"))
        ]
        for role in ("contributor", "reader"):
            member = {"member": keys[role], "role": role}
            put = http.put(f"/v1/projects/{made[0]}/members", json=member, headers=auth["owner"])
            assert put.status_code == 200, put.text
        inside = {who: {**auth[who], "Bentray-Project": made[0]} for who in auth}
        ids = one_of_each(app, http, Tenant(made[0]), inside["owner"])
        headers = {
            **{f"{who} inside": one for who, one in inside.items()},
            **auth,
            "outsider elsewhere": {**auth["outsider"], "Bentray-Project": made[1]},
        }
        yield World(Place(http, folder, {**ids, "project_id": made[0]}, auth), made[0], headers, keys)


# Outside of the project its members find nothing of it either, and no member of another one does.
@pytest.mark.parametrize("who", ["owner", "outsider", "outsider elsewhere", "outsider inside"])
def test_nothing_of_a_project_is_found_outside(world: World, who: str) -> None:
    tried = 0
    for asked in operations(world.place):
        if "{" not in asked.path or not asked.path.startswith("/v1/"):
            continue
        if who == "owner" and "project_id" in asked.path:
            continue
        body = asked.what.get("requestBody", {}).get("content", {}).get("application/json")
        content = next(iter(body["examples"].values()))["value"] if body else None
        how = {"json": content} if body else {}
        here = filled(asked.path, world.place.ids)
        answer = world.ask(who, asked.verb, here, headers=asked.headers(), **how)
        found = (answer.status_code, answer.json().get("type"))
        assert found == (404, "/problems/unknown-id"), (asked.verb, here, answer.text)
        tried += 1
    assert tried > 15
    for kind, name in (("reconstruction", "dataset"), ("refraction", "volume"), ("geometry-field", "mesh")):
        answer = world.ask(who, "POST", "/v1/jobs", json={"kind": kind, name: world.place.ids[f"{name}_id"]})
        assert answer.status_code == 404
    answer = world.ask(who, "POST", "/v1/batches", json={"datasets": [world.place.ids["dataset_id"]]})
    assert answer.status_code == 404


def test_lists_events_and_counts_have_nothing_of_it(world: World) -> None:
    ids = {name: one for name, one in world.place.ids.items() if name != "project_id"}
    shown = set()
    for asked in operations(world.place):
        if asked.verb != "GET" or "{" in asked.path or not asked.path.startswith("/v1/"):
            continue
        events = "text/event-stream" in asked.what["responses"]["200"]["content"]
        short = {"seconds": 1} if events else {}
        if asked.path == "/v1/jobs":
            short = {"text": ids["job_id"]}
        inside = world.ask("reader inside", "GET", asked.path, params=short).text
        shown |= {name for name, one in ids.items() if one in inside}
        for who in ("owner", "outsider elsewhere") if not events else ("outsider",):
            text = world.ask(who, "GET", asked.path, params=short).text
            assert not [name for name, one in ids.items() if one in text], (asked.path, who)
        assert world.ask("outsider inside", "GET", asked.path, params=short).status_code == 404
    assert shown >= {"dataset_id", "mesh_id", "job_id", "volume_id", "field_id", "batch_id"}
    storage = world.ask("outsider elsewhere", "GET", "/v1/access/storage").json()["storage"]
    assert storage == []
    named = world.ask("outsider", "GET", "/v1/projects").json()["projects"]
    assert [one["name"] for one in named] == ["Two"]


def test_roles_limit_what_members_do(world: World) -> None:
    dataset = f"/v1/datasets/{world.place.ids['dataset_id']}"
    body = {"title": "Left"}
    assert world.ask("reader inside", "GET", dataset).status_code == 200
    assert world.ask("reader inside", "PATCH", dataset, json=body).json()["field"] == "scope"
    assert world.ask("contributor inside", "PATCH", dataset, json=body).status_code == 200
    access = world.ask("reader inside", "GET", "/v1/access").json()
    assert (access["tenant"], access["project"], access["role"]) == ("lab", world.project, "reader")
    assert access["scopes"] == ["read"]
    here = f"/v1/projects/{world.project}"
    someone = {"member": "user:mallory", "role": "owner"}
    for verb, path, how in (
        ("PUT", f"{here}/members", {"json": someone}),
        ("PUT", f"{here}/members", {"json": {**someone, "member": world.keys["owner"], "role": None}}),
        ("PATCH", here, {"json": {"name": "Mine"}}),
        ("DELETE", here, {}),
    ):
        answer = world.ask("contributor", verb, path, **how)
        assert (answer.status_code, answer.json()["field"]) == (403, "role"), (verb, path)
        assert world.ask("outsider", verb, path, **how).status_code == 404
    assert world.ask("owner", "DELETE", here).json()["type"] == "/problems/in-use"
    assert world.ask("owner", "PATCH", here, json={"name": "First"}).json()["name"] == "First"
    assert len(world.ask("reader", "GET", here).json()["members"]) == 3


def test_the_audit_log_names_the_project(world: World, monkeypatch: pytest.MonkeyPatch) -> None:
    dataset = f"/v1/datasets/{world.place.ids['dataset_id']}"
    world.ask("reader inside", "GET", dataset)
    last = list(entries(world.place.folder / "data" / "audit"))[-1]
    assert (last["tenant"], last["project"], last["ids"]) == ("lab", world.project, [dataset[13:]])


def test_a_removed_member_sees_nothing_more(world: World, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(key_watch, "INTERVAL_SECONDS", 0.05)
    leaving = {"member": world.keys["reader"], "role": None}
    with world.place.http.stream(
        "GET", "/v1/events", params={"seconds": 300}, headers=world.headers["reader inside"]
    ) as stream:
        begun = time.monotonic()
        # Everyone may leave.
        assert world.ask("reader", "PUT", f"/v1/projects/{world.project}/members", json=leaving).is_success
        list(stream.iter_bytes())
        assert time.monotonic() - begun < 200.0
    assert world.ask("reader inside", "GET", "/v1/jobs").status_code == 404


def test_projects_through_the_client(serve: Any, scan: Any, tmp_path: Path) -> None:
    address = serve()
    with Client(address) as client:
        made = client.create_project("Trial 7")
        members = client.set_member(made, "user:alice", "reader")
        assert [(one.member, one.role) for one in members] == [("user:alice", "reader")]
        assert client.project(made).members[0].member == "user:alice"
        with Client(address, project=made.id) as inside:
            dataset = inside.upload(scan())
            assert [one.id for one in inside.datasets()] == [dataset.id]
            assert client.datasets() == []
            inside.delete(dataset)
        client.delete_project(made)
        assert client.projects() == []
