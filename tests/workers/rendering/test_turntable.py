"""Turntables: every picture once, from all sides, in one file; stopped in between; planned."""

import json
import struct
import zipfile
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from bentray_kernels.errors import InvalidInput
from bentray_kernels.phantoms import TWO_HOLES, sampled
from bentray_kernels.task_graph import Cancelled
from bentray_workers.cluster.capacities import MIB, WorkerCapacity
from bentray_workers.files.volume import Volume, write_volume
from bentray_workers.rendering.refraction import picture_png
from bentray_workers.rendering.refraction_view import RefractionView
from bentray_workers.rendering.turntable import Turntable, TurntableGraph, draw_turntable
from bentray_workers.rendering.turntable_planning import plan_turntable

from ..pixels import pixels_of

SMALL = {"iso": (0.5,), "width": 32, "height": 24}


@pytest.fixture
def path(tmp_path):
    write_volume(tmp_path / "v.h5", Volume.from_values(sampled(TWO_HOLES, 12), (1e-3,) * 3))
    return tmp_path / "v.h5"


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "work").mkdir()
    return tmp_path / "work"


def test_frames_go_round():
    table = Turntable(azimuth_deg=350.0, frames=4, zoom=2.0)
    views = [table.frame(k) for k in range(4)]
    assert [view.azimuth_deg for view in views] == [350.0, 80.0, 170.0, 260.0]
    assert type(views[0]) is RefractionView
    assert {view.zoom for view in views} == {2.0}
    assert Turntable(azimuth_deg=10.0, turn_deg=-40.0, frames=2).frame(1).azimuth_deg == 350.0


def test_too_many_pixels_are_refused():
    with pytest.raises(InvalidInput, match=r"^frames: "):
        Turntable(frames=720, width=1024)


def test_a_zip_holds_each_picture(cluster, path, folder, tmp_path):
    table, told = Turntable(**SMALL, frames=3, turn_deg=90.0), []
    draw_turntable(cluster.client, path, table, tmp_path / "t.zip", folder, on_progress=told.append)
    with zipfile.ZipFile(tmp_path / "t.zip") as archive:
        assert archive.namelist() == ["0000.png", "0001.png", "0002.png"]
        pictures = [archive.read(name) for name in archive.namelist()]
    assert pictures == [picture_png(path, table.frame(k)) for k in range(3)]
    assert len(set(pictures)) == 3
    done = [(progress.done, progress.total) for progress in told]
    assert list(dict.fromkeys(done)) == [(0, 3), (1, 3), (2, 3), (3, 3)]
    told.clear()
    # As a service that died half-way leaves it: one picture missing, the others not drawn again.
    (folder / "0000.png").unlink()
    before = {frame.name: frame.stat().st_mtime_ns for frame in folder.iterdir()}
    draw_turntable(cluster.client, path, table, tmp_path / "u.zip", folder, on_progress=told.append)
    assert list(dict.fromkeys((progress.done, progress.total) for progress in told)) == [(2, 3), (3, 3)]
    assert before.items() <= {frame.name: frame.stat().st_mtime_ns for frame in folder.iterdir()}.items()
    assert (tmp_path / "u.zip").read_bytes() == (tmp_path / "t.zip").read_bytes()


def test_an_apng_shows_each_picture(cluster, path, folder, tmp_path):
    table = Turntable(**SMALL, frames=3, turn_deg=90.0, format="apng")
    draw_turntable(cluster.client, path, table, tmp_path / "t.apng", folder)
    control = (tmp_path / "t.apng").read_bytes().partition(b"acTL")[2]
    assert struct.unpack(">II", control[:8]) == (3, 0), "three pictures, without end"
    with Image.open(tmp_path / "t.apng") as picture:
        assert (picture.format, picture.n_frames) == ("PNG", 3)
        for k in range(3):
            picture.seek(k)
            expected = pixels_of(picture_png(path, table.frame(k)))
            np.testing.assert_array_equal(np.asarray(picture.convert("RGB")), expected)
            assert picture.info["duration"] == 80


def test_it_stops_between_pictures(cluster, path, folder, tmp_path):
    told = []
    with pytest.raises(Cancelled):
        draw_turntable(
            cluster.client,
            path,
            Turntable(**SMALL, frames=200),
            tmp_path / "t.zip",
            folder,
            on_progress=told.append,
            stop=lambda: len(told) > 2,
        )
    assert told[-1].done < 200
    assert not list(tmp_path.glob("t.zip*"))


WORKER = WorkerCapacity(1024 * MIB, ("recon", "render"))


SHAPE = (64, 48, 32)


@given(st.sampled_from(["frames", "width", "height", "depth"]), st.integers(1, 64))
def test_more_of_anything_is_more_work(field, by):
    asked = Turntable(frames=10, width=200, height=300)
    more = replace(asked, **{field: getattr(asked, field) + by})
    before, after = (plan_turntable(SHAPE, one, [WORKER]) for one in (asked, more))
    assert after.work_s > before.work_s
    assert after.tasks >= before.tasks
    assert plan_turntable(SHAPE, asked, [WORKER] * 4).work_s < before.work_s
    assert json.loads(json.dumps(before.to_dict()))["largest_bytes"] == max(before.call_bytes.values())


def test_rays_cost_as_the_picture_has_them():
    whole, half, lit = (
        plan_turntable(SHAPE, Turntable(**one), [WORKER])
        for one in ({"ray_spacing": 1}, {"ray_spacing": 2}, {"mode": "shaded"})
    )
    assert whole.work_s / half.work_s == pytest.approx(4.0, rel=0.05)
    assert lit.work_class != whole.work_class == half.work_class
    assert lit.work_s < whole.work_s


def test_the_tasks_are_those_of_the_graph(tmp_path):
    asked = Turntable(frames=5, width=1024, height=1024)
    graph = TurntableGraph(tmp_path / "volume.h5", asked, tmp_path / "target", tmp_path)
    drawing = graph.first()
    # Each frame is written after its tiles, and the file after all frames.
    assert plan_turntable(SHAPE, asked, ()).tasks == len(drawing) + asked.frames + 1


def test_too_little_memory_is_refused():
    small = WorkerCapacity(300 * MIB, ("recon", "render"))
    with pytest.raises(InvalidInput, match=r"volume.*bytes"):
        plan_turntable((512, 512, 512), Turntable(), [small])
    assert plan_turntable((512, 512, 512), Turntable(), ()).workers == 0
