"""`bentray submit --batch` on workers and on a service: results, finished ones left out, failures alone."""

import json
import os
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import Result

from bentray_workers.cluster.connection import open_cluster
from bentray_workers.files.dataset import read_dataset
from bentray_workers.files.reconstruction import read_reconstruction

from .conftest import Run

QUICK = ("--method", "sart", "--nodes", 24, "--iterations", 1, "--rays", "straight")


@pytest.fixture(scope="module")
def address(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """The scheduler of workers in this process."""
    folder = tmp_path_factory.mktemp("dask")
    with open_cluster(workers=1, local_directory=folder, processes=False) as found:
        yield found.client.scheduler.address


@pytest.fixture(autouse=True)
def quick_pictures(monkeypatch: pytest.MonkeyPatch) -> None:
    """The pictures have tests of their own, and take longer than all the rest here."""
    for module in ("bentray_workers.reconstruction.batch", "bentray_workers.images.report"):
        monkeypatch.setattr(
            f"{module}.report_png",
            lambda result, truth, roi: (
                b"\x89PNG of " + (b"no truth" if truth is None else truth.axes.encode())
            ),
        )


@pytest.fixture
def scans(scan_file: Path, tmp_path: Path) -> Path:
    """Two scans, and a file that is none."""
    folder = tmp_path / "scans"
    folder.mkdir()
    for name in ("one", "two"):
        shutil.copy(scan_file, folder / f"{name}.h5")
    (folder / "broken.h5").write_bytes(b"certainly not HDF5")
    (folder / "notes.txt").write_text("not a scan")
    return folder


@pytest.fixture
def submit(bentray: Run, address: str, scans: Path) -> Callable[..., tuple[Result, Any]]:
    """Give the batch and read what it prints."""

    def run(*words: object, code: int = 0) -> tuple[Result, Any]:
        given = ("submit", "--batch", scans, "--scheduler", address, "--json", *QUICK, *words)
        result = bentray(*given, code=code)
        return result, json.loads(result.stdout)

    return run


def states(said: Any) -> dict[str, str]:
    return {one["name"]: one["state"] for one in said["datasets"]}


def test_each_gets_the_files_of_reconstruct_and_a_broken_one_fails_alone(
    submit: Callable[..., tuple[Result, Any]], bentray: Run, scans: Path, tmp_path: Path
) -> None:
    result, said = submit("--out", tmp_path / "out", code=1)
    assert result.stderr.splitlines()[-1] == "bentray: 1 of 3 datasets failed: the reasons are above"
    assert states(said) == {"broken": "failed", "one": "succeeded", "two": "succeeded"}
    assert (said["succeeded"], said["skipped"], said["failed"]) == (2, 0, 1)
    broken = said["datasets"][0]
    assert "HDF5" in broken["reason"]
    assert broken["output"] is None

    bentray("reconstruct", scans / "one.h5", "-o", tmp_path / "here", *QUICK, "--workers", 1)
    names = sorted(path.name for path in (tmp_path / "here").iterdir())
    assert sorted(path.name for path in (tmp_path / "out" / "one").iterdir()) == names
    assert (tmp_path / "out" / "one" / "reconstruction.png").read_bytes() == b"\x89PNG of x,y"
    ours, theirs = (
        read_reconstruction(tmp_path / where / "reconstruction.h5") for where in ("here", "out/one")
    )
    np.testing.assert_array_equal(ours.speed, theirs.speed)
    figures = json.loads((tmp_path / "out" / "one" / "reconstruction.json").read_text())
    assert figures["residual_rms_s"] == said["datasets"][1]["residual_rms_s"]


def test_only_finished_entries_are_skipped(
    submit: Callable[..., tuple[Result, Any]], scans: Path, scan_file: Path
) -> None:
    submit(code=1)
    results = scans / "results"
    stamps = {path: path.stat().st_mtime_ns for path in results.glob("*/reconstruction.h5")}
    shutil.copy(scan_file, scans / "broken.h5")
    _, said = submit()
    assert states(said) == {"broken": "succeeded", "one": "skipped", "two": "skipped"}
    assert {path: path.stat().st_mtime_ns for path in stamps} == stamps
    assert said["datasets"][1]["seconds"] > 0.0

    damaged = results / "one" / "reconstruction.h5"
    damaged.write_bytes(damaged.read_bytes()[:1000])
    os.utime(scans / "two.h5", ns=(1, 1))
    assert states(submit()[1]) == {"broken": "skipped", "one": "succeeded", "two": "succeeded"}
    assert set(states(submit("--penalty-strength", 2)[1]).values()) == {"succeeded"}


def test_without_json_it_ends_with_a_table_and_the_reasons(bentray: Run, address: str, scans: Path) -> None:
    result = bentray("submit", "--batch", scans, "--scheduler", address, "--at-once", 1, *QUICK, code=1)
    assert result.stdout.splitlines()[0].rstrip() == "Batch of scans"
    assert "broken: file: found" in result.stdout
    assert result.stdout.splitlines()[-1] == str(scans / "results")
    told = [line.split(" after ")[0] for line in result.stderr.splitlines()]
    assert [line for line in told if " " in line][:3] == ["broken failed", "one succeeded", "two succeeded"]


def test_scans_of_other_programs_are_converted(
    bentray: Run, address: str, scan_file: Path, tmp_path: Path
) -> None:
    scan, folder = read_dataset(scan_file), tmp_path / "scans"
    folder.mkdir()
    position = 1e3 * scan.element_position_m
    np.savez(folder / "own.npz", pos=position, tx=scan.tx, rx=scan.rx, dtof=scan.delta_tof_s)
    words = ("--map", "element_position=pos", "--map", "delta_tof=dtof", "--unit", "mm", "--sound-speed")
    batch = ("submit", "--batch", folder, "--scheduler", address, "--json", *QUICK, *words)
    assert states(json.loads(bentray(*batch, 1500).stdout)) == {"own": "succeeded"}
    found = read_reconstruction(folder / "results" / "own" / "reconstruction.h5")
    bentray("reconstruct", folder / "own.npz", *words, 1500, *QUICK, "-o", tmp_path / "alone")
    expected = read_reconstruction(tmp_path / "alone" / "reconstruction.h5")
    np.testing.assert_array_equal(found.speed, expected.speed)
    assert not list((folder / "results" / "own").glob(".converted*"))
    # The same file with other options is another request.
    for speed, state in ((1500, "skipped"), (1490, "succeeded")):
        assert states(json.loads(bentray(*batch, speed).stdout)) == {"own": state}


def test_two_scans_of_the_same_name_are_rejected(bentray: Run, scans: Path) -> None:
    (scans / "one.mat").write_bytes(b"")
    result = bentray("submit", "--batch", scans, "--scheduler", "tcp://127.0.0.1:1", code=2)
    assert "found one.h5 and one.mat; accepted: names that differ" in result.stderr


def test_a_folder_of_scans_on_a_service(bentray: Run, serve: Any, work: Any, scans: Path) -> None:
    words = ("submit", "--batch", scans, "--url", serve(), "--json", *QUICK)
    first = bentray(*words, code=1)
    assert states(json.loads(first.stdout)) == {"broken": "failed", "one": "succeeded", "two": "succeeded"}
    for name in ("one", "two"):
        assert read_reconstruction(scans / "results" / name / "reconstruction.h5").speed.shape == (24, 24)
    # Equal files are one scan on the service, and one job.
    assert len(work.calls) == 1
    (scans / "broken.h5").unlink()
    again = bentray(*words)
    assert json.loads(again.stdout)["skipped"] == 2
    assert len(work.calls) == 1
    shutil.rmtree(scans / "results")
    assert json.loads(bentray(*words, "--no-wait").stdout)["size"] == 1
