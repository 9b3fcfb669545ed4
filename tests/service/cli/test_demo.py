"""`bentray demo`: the whole path through a real service, small; and its validation of the results."""

import json
import re
from pathlib import Path
from typing import Any

import httpx
import pytest

from bentray_service.cli import demo as module
from bentray_workers.simulation.request import SAMPLE

from .conftest import Run

# Half the frequency and half the elements of the sample: a sixteenth of the work.
SMALL = {**SAMPLE, "nodes": 64, "elements": 36, "emissions": 12, "frequency_hz": 1.25e5}
README = (Path(__file__).resolve().parents[3] / "README.md").read_text()

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("sample", [SMALL, pytest.param(SAMPLE, marks=pytest.mark.nightly)])
def test_the_whole_path_ends_with_full_waveforms_ahead_and_a_picture(
    bentray: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, sample: dict[str, Any]
) -> None:
    monkeypatch.setattr(module, "SAMPLE", sample)
    result = bentray("demo", "-o", tmp_path / "out", "--json")
    said = json.loads(result.stdout)
    errors = said["rmse_mps"]
    assert list(errors) == [*module.JOBS, "best constant"]
    assert min(errors, key=lambda name: errors[name]) == "full waveform"
    assert {name: job["truth"]["rmse_mps"] for name, job in said["jobs"].items()}.items() < errors.items()
    assert said["jobs"]["straight rays"]["settings"]["rays"] == "straight"
    assert said["picture"] == str(tmp_path / "out" / "comparison.png")
    assert Path(said["picture"]).read_bytes().startswith(b"\x89PNG\r\n")
    log = (tmp_path / "out" / "service.log").read_text()
    assert "Traceback" not in log
    url = re.search(r"http://127\.0\.0\.1:\d+", log)
    assert url is not None
    with pytest.raises(httpx.TransportError):
        httpx.get(f"{url[0]}/health/live", timeout=5)
    if sample is SAMPLE:
        table = re.findall(r"^\| ([a-z ]+) \| \**([\d.]+)\** \| \S+ \| \S+ \|$", README, re.MULTILINE)
        assert {name: float(error) for name, error in table} == pytest.approx(errors, abs=0.1)


@pytest.mark.nightly
def test_it_fails_in_one_line_when_full_waveforms_do_not_win(
    bentray: Run, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(module, "SAMPLE", SMALL)
    monkeypatch.setattr(module, "JOBS", {name: {"method": "sart"} for name in module.JOBS})
    result = bentray("demo", "-o", tmp_path, code=1)
    assert "full waveforms are not the most accurate: straight rays" in result.stderr.splitlines()[-1]
    assert "rms error" in result.stdout, "the figures are shown all the same"
