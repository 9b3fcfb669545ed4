"""Lists, batches, quality and pictures of the client, ids and records alike, and in a notebook."""

import asyncio
import inspect

import numpy as np
import pytest

import bentray
from bentray_kernels.errors import InvalidInput
from bentray_kernels.requests.ranges import Range
from bentray_service.client import AsyncClient, Client, ClientError
from bentray_service.client.lists import JobKind
from bentray_service.html_tables import RecordList
from bentray_service.jobs.kinds import KINDS


def test_everything_stored_is_listed_newest_first(client, scan, tmp_path):
    first, second = client.upload(scan()), client.upload(scan())
    # One after the other: of jobs that run at once, the result of either may be the older one.
    done = [client.wait(client.submit(first, nodes=16, method="sart", iterations=1)) for _ in range(3)]
    assert [one.id for one in client.datasets()] == [second.id, first.id]
    assert [one.id for one in client.datasets(1)] == [second.id]
    assert [one.id for one in client.datasets(text=first.id.upper())] == [first.id]
    assert client.datasets(text="no such scan") == []
    assert [one.id for one in client.jobs()] == [job.id for job in reversed(done)]
    assert [one.id for one in client.volumes()] == [job.volume for job in reversed(done)]
    assert client.meshes() == []
    assert client.dataset(first) == first
    assert client.volume(done[0]).job == done[0].id
    assert client.jobs(state="failed") == []
    assert len(client.jobs(kind="reconstruction", text=done[1].id)) == 1


def test_a_corrected_copy_of_a_scan(client, scan):
    first = client.upload(scan())
    made = client.correct_dataset(first, frequency_hz=np.float64(5e5))
    assert made.source == f"Corrected copy of {first.id}: frequency 500000 Hz"
    assert client.dataset(first) == first
    with pytest.raises(ClientError, match="times_in"):
        client.correct_dataset(first)


def test_more_jobs_than_one_request_gives(client, scan, monkeypatch):
    dataset = client.upload(scan())
    jobs = [client.submit(dataset, nodes=16, iterations=1).id for _ in range(5)]
    monkeypatch.setattr("bentray_service.client.lists.LIMIT", Range(1, 2))
    assert [one.id for one in client.jobs()] == jobs[::-1]
    assert [one.id for one in client.jobs(3)] == jobs[:1:-1]
    with pytest.raises(InvalidInput, match="limit: found 0"):
        client.jobs(0)
    with pytest.raises(InvalidInput, match="limit: found 3; accepted: a number from 1 to 2"):
        client.datasets(3)


def test_kinds_of_jobs_are_those_of_the_service():
    assert set(JobKind.__args__) == set(KINDS)


def test_a_notebook_shows_records_and_lists(client, scan):
    dataset = client.upload(scan())
    assert "<td" in client.datasets()._repr_html_()
    assert dataset.id in client.datasets()._repr_html_()
    assert "Sixteen elements" in dataset._repr_html_()
    assert RecordList()._repr_html_() == "<em>none</em>"
    assert repr(client) == f"<bentray.Client of {client.url}>"


def test_quality_and_pictures(client, scan, tmp_path):
    dataset = client.upload(scan())
    quality = client.quality(dataset)
    assert quality.verdict in ("clean", "usable")
    assert "verdict" in quality._repr_html_()
    job = client.wait(client.submit(dataset, nodes=16, iterations=1))
    picture = client.slice_png(job, size=240)
    assert picture._repr_png_().startswith(b"\x89PNG")
    assert "of 240 x " in repr(picture) or "x 240 pixels" in repr(picture)
    assert picture.save(tmp_path / "slice.png").read_bytes() == picture
    with pytest.raises(ClientError, match="volume"):
        client.refraction_png(job)
    with pytest.raises(InvalidInput, match="widht: found 64; accepted: width is spelt like it"):
        client.refraction_png(job, widht=64)


def test_a_volume_is_rendered(client, tmp_path):
    values = np.linspace(0.0, 1.0, 512, dtype=np.float32).reshape(8, 8, 8)
    np.save(tmp_path / "cube.npy", values)
    volume = client.upload(tmp_path / "cube.npy", kind="volume", spacing_m="0.002")
    picture = client.refraction_png(
        volume, iso=(0.3, 0.6), index=(1.2, 1.5), width=24, height=16, fresnel=True
    )
    assert repr(picture) == "<bentray.Picture of 24 x 16 pixels>"


def test_settings_by_name_join_nested_ones(client, scan):
    dataset = client.upload(scan())
    nested = {"picking": {"examine": False}, "iterations": 9}
    job = client.submit(
        dataset, nested, penalty_strength=np.float64(0.2), iterations=1, nodes=16, picker="energy-ratio"
    )
    picking = job.settings["picking"]
    assert (picking["examine"], picking["picker"]) == (False, "energy-ratio")
    assert (job.settings["gauss_newton"], job.settings["iterations"]) == ({"penalty_strength": 0.2}, 1)
    assert nested == {"picking": {"examine": False}, "iterations": 9}
    with pytest.raises(InvalidInput, match=r"penalty_strenth: found .*; accepted: penalty_strength is spelt"):
        client.submit(dataset, penalty_strenth=0.2)
    with pytest.raises(ClientError, match=r"settings\.itertions: found 2; accepted: iterations is spelt"):
        client.submit(dataset, {"itertions": 2})
    with pytest.raises(InvalidInput, match="elemnts: found 8; accepted: elements is spelt like it"):
        client.simulate(elemnts=8)
    assert client.simulate(phantom="detailed", nodes=16, elements=16).settings["phantom"] == "detailed"


def test_one_call_from_a_scan_to_its_result(client, scan):
    own = bentray.read(scan())
    result = client.reconstruct(own, "sart", nodes=16, iterations=1, progress=False)
    assert result.speed.max() == 1540.0
    again = client.reconstruct(client.datasets()[0].id, "sart", nodes=16, progress=False)
    np.testing.assert_array_equal(again.speed, result.speed)
    assert result.compare(again).rms == 0.0
    assert len(client.datasets()) == 1
    with pytest.raises(InvalidInput, match="accepted: iterations is spelt like it"):
        client.reconstruct(scan(), itertions=1)
    assert len(client.datasets()) == 1, "refused before the upload"


def test_a_job_without_a_result_says_so(client, scan, work):
    work.hold.clear()
    job = client.submit(client.upload(scan()), nodes=16)
    with pytest.raises(ClientError, match=r"has no volume: wait for it with client\.wait"):
        client.result(job)
    client.cancel(job)


def test_both_clients_have_the_same_methods_and_signatures():
    def methods(of):
        return {
            name: inspect.signature(method)
            for name, method in inspect.getmembers(of, inspect.isfunction)
            if not name.startswith("_")
        }

    own, other = methods(Client), methods(AsyncClient)
    assert own.keys() == other.keys()
    own.pop("close")
    other.pop("close")
    assert own == other
    assert inspect.signature(Client) == inspect.signature(AsyncClient)
    assert {"datasets", "jobs", "volumes", "quality", "refraction_png", "slice_png"} <= own.keys()
    for name, method in inspect.getmembers(AsyncClient, inspect.isfunction):
        if name in own:
            assert inspect.iscoroutinefunction(method), name
            assert method.__doc__ == getattr(Client, name).__doc__


QUICK = {"method": "sart", "nodes": 16, "iterations": 1}


def test_one_progress_for_many_scans(serve, scan, work):
    address = serve()
    with Client(address, poll_s=0.02) as client:
        datasets = [
            client.upload(scan(lambda file, one=one: file.attrs.update(title=one), f"{one}.h5"))
            for one in ("a", "b")
        ]
        seen = []
        batch = client.submit_batch(datasets, {"nodes": 99}, name="Two", **QUICK)
        assert (batch.settings["nodes"], batch.settings["iterations"]) == (16, 1)
        done = client.wait_batch(batch, lambda one: seen.append(one.progress))
        assert (done.state, done.counts, seen[-1]) == ("succeeded", {"succeeded": 2}, 1.0)
        assert seen == sorted(seen)
        assert [batch.id for batch in client.batches()] == [batch.id]
        assert client.batch(batch.id).jobs[0].volume is not None
        work.hold.clear()
        batch = client.submit_batch(datasets[:1], **QUICK)
        with pytest.raises(ClientError, match="is still"):
            client.wait_batch(batch, timeout_s=0.05)
        client.cancel_batch(batch)
        work.hold.set()
        assert client.wait_batch(batch.id).state == "cancelled"

    async def go():
        async with AsyncClient(address) as client:
            return [batch.state for batch in await client.batches(1)]

    assert asyncio.run(go()) == ["cancelled"]
