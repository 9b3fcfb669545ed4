"""Geometry fields: settings and views are checked; made by tasks as by the kernels, resumed, once each."""

from dataclasses import replace

import numpy as np
import pytest

from bentray_kernels.errors import InvalidInput
from bentray_kernels.geometry_field.tables.inner_field import build_inner_rows, inner_field, spread_points
from bentray_kernels.geometry_field.tables.outer_field import build_rows, outer_field
from bentray_kernels.geometry_field.tracing.lookup_scene import WAYS
from bentray_kernels.meshes.example_surfaces import bumpy_ball, torus
from bentray_kernels.meshes.surface import surface_of
from bentray_kernels.task_graph import Cancelled
from bentray_workers.files.geometry_field_folder import FieldFiles, mapped, read_chart
from bentray_workers.rendering import field_tasks, geometry_field
from bentray_workers.rendering.field_settings import MAX_FACES, FieldSettings, check_faces
from bentray_workers.rendering.field_view import LOOKUPS, FieldView
from bentray_workers.rendering.geometry_field import build_field, bytes_of

from .field_folders import SMALL, stored


@pytest.fixture
def path(tmp_path):
    (tmp_path / "work").mkdir()
    return stored(tmp_path, torus(16, 10))


@pytest.fixture
def small_batches(monkeypatch):
    """Seven and more tasks for each table."""
    monkeypatch.setattr(geometry_field, "TASK_RAYS", 32 * 6 * 6**2)


def made(path, tmp_path, name="field", on_progress=None, stop=None, settings=SMALL, client=None):
    """The figures of the field, built into a folder of that name."""
    return build_field(
        client, path, settings, tmp_path / name, tmp_path / "work", on_progress=on_progress, stop=stop
    )


def test_the_tables_are_those_of_the_kernels(path, tmp_path, small_batches):
    told = []
    figures = made(path, tmp_path, on_progress=told.append)
    files = FieldFiles(tmp_path / "field")
    surface = surface_of(read_chart(files.chart))
    outer = outer_field(6, [build_rows(surface, 6, 0, 216)])
    points, starts = spread_points(surface, 4)
    inner = inner_field(4, starts, [build_inner_rows(surface, 4, points)])
    assert (outer.faces >= 0).mean() > 0.01
    np.testing.assert_array_equal(mapped(files.outer[0]), outer.faces)
    np.testing.assert_array_equal(mapped(files.outer[1]), outer.fractions)
    np.testing.assert_array_equal(mapped(files.inner), inner.faces)
    np.testing.assert_array_equal(mapped(files.starts), inner.starts)
    assert figures["outer_tasks"] == 7
    assert (figures["faces"], figures["points"]) == (320, len(points))
    assert 0.0 < figures["image_rms"] < 0.05
    assert figures["lookup_median"] < 1e-6
    assert figures["lookup_wrong"] < 0.1
    assert min(figures[f"{part}_seconds"] for part in ("outer", "inner", "image")) > 0.0
    assert bytes_of(tmp_path / "field") > figures["outer_bytes"] + figures["inner_bytes"]
    total = 2 + figures["outer_tasks"] + figures["inner_tasks"]
    # Stages of the layout are shown as long as they last.
    tables = [(step.done, step.total) for step in told if step.phase == "sampling" and step.total]
    assert tables == [(k, total) for k in range(1, total + 1)]
    assert {step.phase for step in told} <= {"", "cutting", "parameterising", "sampling"}


def test_interrupted_job_resumes(path, tmp_path, small_batches):
    told = []
    with pytest.raises(Cancelled):
        made(path, tmp_path, on_progress=told.append, stop=lambda: len(told) > 4)
    assert not (tmp_path / "field").exists()
    done = {mark.name: mark.stat().st_mtime_ns for mark in (tmp_path / "work" / "done").glob("*.json")}
    assert len(done) >= 2
    # As a crash leaves it: rows that were begun and not told to be done.
    torn = next(iter(done))
    (tmp_path / "work" / "done" / torn).unlink()
    table = FieldFiles(tmp_path / "work" / "field").outer[0 if torn.startswith("outer") else 1]
    first = int(torn[6:11])
    mapped(table, "r+")[first : first + 5] = 77
    layout = FieldFiles(tmp_path / "work" / "field").layout.stat().st_mtime_ns
    again = []
    made(path, tmp_path, on_progress=again.append)
    # The layout in place of the torn batch; what was in flight at the stop may have ended since.
    assert again[0].done >= len(done)
    assert FieldFiles(tmp_path / "field").layout.stat().st_mtime_ns == layout
    kept = {mark.name: mark.stat().st_mtime_ns for mark in (tmp_path / "work" / "done").glob("*.json")}
    assert all(kept[name] == when for name, when in done.items() if name != torn)
    (tmp_path / "other").mkdir()
    build_field(None, path, SMALL, tmp_path / "whole", tmp_path / "other")
    for name in ("outer-faces.npy", "outer-fractions.npy", "inner-faces.npy"):
        assert (tmp_path / "whole" / name).read_bytes() == (tmp_path / "field" / name).read_bytes()


def test_resumes_after_a_kill_between_boundary_and_table(path, tmp_path, monkeypatch):
    whole = made(path, tmp_path, "whole")
    (tmp_path / "whole").rename(tmp_path / "work" / "field")
    FieldFiles(tmp_path / "work" / "field").figures.unlink()
    before = FieldFiles(tmp_path / "work" / "field").outer[0].read_bytes()
    again = made(path, tmp_path, "again")
    assert FieldFiles(tmp_path / "again").outer[0].read_bytes() == before
    assert again["lookup_wrong"] == whole["lookup_wrong"]


def test_existing_field_is_reused(path, tmp_path, monkeypatch):
    first = made(path, tmp_path)
    told = []
    monkeypatch.setattr(geometry_field, "GeometryFieldGraph", None)
    assert made(path, tmp_path, on_progress=told.append) == first
    assert told[-1].done == told[-1].total


def test_two_at_once_make_one(path, tmp_path):
    made(path, tmp_path)
    before = FieldFiles(tmp_path / "field").figures.read_bytes()
    geometry_field._move(tmp_path / "field", tmp_path / "field")
    (tmp_path / "late").mkdir()
    (tmp_path / "late" / "figures.json").write_text("late")
    geometry_field._move(tmp_path / "late", tmp_path / "field")
    assert FieldFiles(tmp_path / "field").figures.read_bytes() == before


@pytest.mark.nightly
def test_a_threshold_halves_the_image(path, tmp_path):
    settings = FieldSettings(samples=4, inner_samples=4, divisions=2, image_size=129, image_threshold=1e-3)
    assert made(path, tmp_path, settings=settings)["image_rms"] < 1e-3
    coarser = FieldSettings(samples=4, inner_samples=4, divisions=2, image_size=129, image_threshold=0.02)
    figures = made(path, tmp_path, "coarser", settings=coarser)
    assert (figures["image_pixels"], figures["image_rms"] > 1e-3) == (33, True)


def test_rejects_invalid_input(path, tmp_path, monkeypatch):
    settings = FieldSettings(samples=4, inner_samples=4, image_size=33, image_threshold=1e-9)
    with pytest.raises(InvalidInput, match="threshold"):
        made(path, tmp_path, settings=settings)
    monkeypatch.setattr(field_tasks, "MAX_INNER", 100)
    with pytest.raises(InvalidInput, match="fewer divisions"):
        made(path, tmp_path)
    assert not (tmp_path / "field").exists()


@pytest.mark.nightly
def test_an_open_surface(tmp_path):
    (tmp_path / "work").mkdir()
    whole = bumpy_ball(500)
    keep = whole.corners.mean(axis=1)[:, 2] < 0.5
    path = stored(tmp_path, type(whole)(whole.vertices, whole.faces[keep]))
    figures = made(path, tmp_path)
    assert figures["faces"] == keep.sum()
    assert figures["lookup_median"] < 1e-6


def test_tasks_that_run_again_change_nothing(path, tmp_path, small_batches):
    """They do after the death of a worker whose results somebody still refers to."""
    made(path, tmp_path)
    (tmp_path / "field").rename(tmp_path / "work" / "field")
    files, done = FieldFiles(tmp_path / "work" / "field"), tmp_path / "work" / "done"
    before = [table.read_bytes() for table in (*files.outer, files.inner)]
    field_tasks.parameterise_mesh(path, SMALL, files.layout.parent)
    field_tasks.outer_rows(files.layout.parent, 6, 0, 32, done / "outer-00000.json")
    field_tasks.inner_rows(files.layout.parent, 4, 0, 32, done / "inner-00000.json")
    assert [table.read_bytes() for table in (*files.outer, files.inner)] == before


OTHER = {"samples": 12, "inner_samples": 8, "divisions": 4, "image_size": 129, "image_threshold": 1e-3}


def test_every_setting_and_the_mesh_name_the_field():
    plain = FieldSettings()
    assert set(OTHER) == set(plain.plain())
    names = {replace(plain, **{name: value}).content("a") for name, value in OTHER.items()}
    names |= {plain.content("a"), plain.content("b")}
    assert len(names) == len(OTHER) + 2
    assert FieldSettings().content("a") == plain.content("a")


def test_a_mesh_that_is_too_large():
    check_faces(MAX_FACES)
    with pytest.raises(InvalidInput, match="mesh"):
        check_faces(MAX_FACES + 1)


def test_published_lookups_have_a_largest_number_of_samples():
    FieldView().check_samples(48)
    FieldView(eye="uv-linear").check_samples(24)
    for name in ("lookup", "eye"):
        with pytest.raises(InvalidInput, match="samples"):
            FieldView(**{name: "uv-nearest"}).check_samples(25)
    assert set(LOOKUPS.values()) <= set(WAYS)


@pytest.mark.parametrize(
    ("scene", "places", "accepted"),
    [
        ("object", (0.0, 0.0), "none: this scene has one object"),
        ("two-mirrors", (1.0, 2.0), "none, or 4: x and y of each object"),
        ("mirror-ball", (0.0,) * 4, "none, or 6: x and y of each object"),
        ("two-mirrors", (0.0, 0.0, 0.0, 5.1), "a number from -5 to 5 m"),
        ("two-mirrors", (0.0, 0.0, 0.0, float("nan")), "a number from -5 to 5 m"),
    ],
)
def test_positions_are_those_of_the_objects(scene, places, accepted):
    with pytest.raises(InvalidInput, match="positions_m") as caught:
        FieldView(scene=scene, positions_m=places)
    assert caught.value.accepted == accepted
    view = FieldView(scene="two-mirrors", positions_m=(0.0, 1.0, 2.0, 3.0))
    assert view.plain()["positions_m"] == [0.0, 1.0, 2.0, 3.0]


def test_too_many_rays():
    with pytest.raises(InvalidInput, match="rays"):
        FieldView(width=4096, height=4096, rays=2)
