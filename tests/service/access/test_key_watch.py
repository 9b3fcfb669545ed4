"""Revoking a key ends its open requests, also when another process revokes it."""

import threading
import time

import httpx
import numpy as np
import pytest

from bentray_service.access import key_watch
from bentray_service.rows.database import open_database
from bentray_service.rows.ids import LOCAL
from bentray_service.rows.keys import ApiKey, Keys, Sessions
from bentray_service.rows.projects import Projects

from ..conftest import STREAM, created

PATIENCE_S = 60.0


@pytest.fixture(autouse=True)
def quick(monkeypatch):
    monkeypatch.setattr(key_watch, "INTERVAL_SECONDS", 0.05)


@pytest.fixture
def keys(tmp_path):
    """The rows of keys by a connection of their own, as `bentray keys` has it."""
    (tmp_path / "served").mkdir()
    database = open_database(f"sqlite:///{tmp_path / 'served' / 'bentray.sqlite'}")
    yield Keys(database)
    database.close()


@pytest.fixture
def held(keys):
    """Two keys, of one tenant."""
    tokens = [ApiKey.new(), ApiKey.new()]
    for number, token in enumerate(tokens):
        keys.add(token, LOCAL, f"key {number}", ("read", "write"))
    return tokens


def caller(url, token):
    headers = {"Authorization": f"Bearer {token.shown()}"}
    return httpx.Client(base_url=url, headers=headers, timeout=PATIENCE_S)


@pytest.mark.parametrize("how", ["revoked", "expired"])
def test_a_stream_of_events_ends_with_its_key_alone(
    serve, keys, held, uploaded, submitted, until, work, how, monkeypatch
):
    url = serve()
    work.hold.clear()
    first, second = held
    with caller(url, first) as mine, caller(url, second) as other:
        job = submitted(mine, uploaded(mine))
        until(mine, job["id"], "running")
        place = f"/v1/jobs/{job['id']}/events"
        with mine.stream("GET", place) as ending, other.stream("GET", place) as staying:
            lines, kept = ending.iter_lines(), staying.iter_lines()
            assert next(lines).startswith("id: ")
            assert next(kept).startswith("id: ")
            if how == "revoked":
                keys.revoke(first.id)
            else:
                monkeypatch.setattr(Keys, "ended", lambda self, ids: [one for one in ids if one == first.id])
            # To an end that is one, so that a browser asks again and is told 401.
            assert all(not line.startswith("data: ") or "succeeded" not in line for line in lines)
            work.hold.set()
            assert any('"succeeded"' in line for line in kept)
        if how == "revoked":
            assert mine.get(place).status_code == 401


def test_an_upload_ends_in_401(serve, keys, held, scan, tmp_path):
    url, begun = serve(), threading.Event()
    content = scan().read_bytes()

    def slowly():
        yield content[:1000]
        keys.revoke(held[0].id)
        begun.set()
        for _ in range(400):
            time.sleep(0.02)
            yield bytes(2000)

    with caller(url, held[0]) as http:
        answer = http.post("/v1/datasets", content=slowly(), headers={"Content-Type": "application/x-hdf5"})
        assert begun.is_set()
        assert (answer.status_code, answer.json()["type"]) == (401, "/problems/not-let-in")
    assert not list(tmp_path.glob("served/tenants/*/incoming/*"))


def test_a_download_is_broken_off(serve, keys, held, monkeypatch):
    url = serve()
    values = np.random.default_rng(0).normal(size=(140, 140, 140))
    with caller(url, held[0]) as http:
        given = {"spacing_m": 1e-3, "shape": "140,140,140", "dtype": "float64"}
        made = created(http.post("/v1/volumes", params=given, content=values.tobytes(), headers=STREAM))
        with http.stream("GET", made["links"]["data"], params={"format": "npy"}) as answer:
            assert answer.status_code == 200
            coming = answer.iter_raw(65536)
            next(coming)
            keys.revoke(held[0].id)
            # Read more slowly than the service looks for keys that have ended.
            with pytest.raises(httpx.RemoteProtocolError):
                [time.sleep(0.02) for _ in coming]


def test_a_request_that_ended_is_not_watched(keys, held, tmp_path):
    watch = key_watch.KeyWatch(keys, Sessions(keys._database), Projects(keys._database))

    async def go():
        with watch.during(held[0].id, lambda: pytest.fail("it had ended")):
            pass
        keys.revoke(held[0].id)
        ended = []
        with watch.during(held[0].id, lambda: ended.append(1)):
            await key_watch.asyncio.sleep(0.5)
        assert ended == [1]
        await key_watch.asyncio.sleep(0.2)
        assert watch._polling is None

    key_watch.asyncio.run(go())
