"""`bentray submit --batch` on a service: one batch, a folder of results each, and a second run that skips."""

import json
import shutil

import pytest

from bentray_workers.files.reconstruction import read_reconstruction

QUICK = ("--method", "sart", "--nodes", 24, "--iterations", 1, "--rays", "straight")


@pytest.fixture
def quick_pictures(monkeypatch):
    monkeypatch.setattr(
        "bentray_workers.images.report.report_png", lambda result, truth, roi: b"\x89PNG of a report"
    )


def test_a_folder_of_scans(bentray, serve, work, quick_pictures, scan_file, tmp_path):
    folder, address = tmp_path / "scans", serve()
    folder.mkdir()
    for name in ("one", "two"):
        shutil.copy(scan_file, folder / f"{name}.h5")
    (folder / "broken.h5").write_bytes(b"certainly not HDF5")
    words = ("submit", "--batch", folder, "--url", address, "--json", *QUICK)
    first = bentray(*words)
    said = json.loads(first.stdout)
    assert first.exit_code == 1
    states = {sentence["name"]: sentence["state"] for sentence in said["datasets"]}
    assert states == {"broken": "failed", "one": "succeeded", "two": "succeeded"}
    for name in ("one", "two"):
        assert read_reconstruction(folder / "results" / name / "reconstruction.h5").speed.shape == (24, 24)
    # Equal files are one scan on the service, and one job.
    assert len(work.calls) == 1
    (folder / "broken.h5").unlink()
    again = bentray(*words)
    assert again.exit_code == 0, again.stderr
    assert json.loads(again.stdout)["skipped"] == 2
    assert len(work.calls) == 1
    shutil.rmtree(folder / "results")
    queued = bentray(*words, "--no-wait")
    assert json.loads(queued.stdout)["size"] == 1
