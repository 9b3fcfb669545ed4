"""`bentray demo`: the whole path through a real service, small; and its validation of the results."""

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import httpx
import pytest
from typer.testing import Result

from bentray_service.cli import demo as module
from bentray_workers.simulation.request import SAMPLE

# Half the frequency and half the elements of the sample: a sixteenth of the work.
SMALL = {**SAMPLE, "nodes": 64, "elements": 36, "emissions": 12, "frequency_hz": 1.25e5}


@pytest.fixture(autouse=True)
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("BENTRAY_WORKERS", "1")
    monkeypatch.setattr(module, "SAMPLE", SMALL)


@pytest.mark.slow
def test_the_whole_path_ends_with_full_waveforms_ahead_and_a_picture(
    bentray: Callable[..., Result], tmp_path: Path, drawn: Any
) -> None:
    result = bentray("demo", "-o", tmp_path / "out", "--json")
    assert result.exit_code == 0, result.stderr
    said = json.loads(result.stdout)
    errors = said["rmse_mps"]
    assert list(errors) == [*module.JOBS, "best constant"]
    assert min(errors, key=lambda name: errors[name]) == "full waveform"
    for name, computed in said["jobs"].items():
        truth = computed["truth"]
        assert truth["rmse_mps"] == errors[name]
        shown = f"{100 * truth['mean_absolute_error_of_range']:.1f} % of range, {errors[name]:.1f} m/s rms"
        assert f"{name.capitalize()}\n{shown}" in drawn.words(), "picture and figures agree"
    assert f"Phantom\nbest constant: {errors['best constant']:.1f} m/s rms" in drawn.words()
    assert said["jobs"]["straight rays"]["settings"]["rays"] == "straight"
    assert said["jobs"]["full waveform"]["settings"]["method"] == "waveform"
    assert said["picture"] == str(tmp_path / "out" / "comparison.png")
    assert Path(said["picture"]).read_bytes().startswith(b"\x89PNG\r\n")
    log = (tmp_path / "out" / "service.log").read_text()
    assert "Traceback" not in log
    url = re.search(r"http://127\.0\.0\.1:\d+", log)
    assert url is not None
    with pytest.raises(httpx.TransportError):
        httpx.get(f"{url[0]}/health/live", timeout=5)


@pytest.mark.slow
@pytest.mark.nightly
def test_it_fails_in_one_line_when_full_waveforms_do_not_win(
    bentray: Callable[..., Result], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(module, "JOBS", {name: {"method": "sart"} for name in module.JOBS})
    result = bentray("demo", "-o", tmp_path)
    assert result.exit_code == 1
    assert "full waveforms are not the most accurate: straight rays" in result.stderr.splitlines()[-1]
    assert "rms error" in result.stdout, "the figures are shown all the same"


@pytest.mark.slow
@pytest.mark.nightly
def test_the_errors_of_the_sample_scan_are_those_of_the_readme(
    bentray: Callable[..., Result], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(module, "SAMPLE", SAMPLE)
    result = bentray("demo", "-o", tmp_path, "--json")
    text = (Path(__file__).resolve().parents[3] / "README.md").read_text()
    stated = re.findall(r"^\| ([a-z ]+) \| \**([\d.]+)\** \| \S+ \| \S+ \|$", text, re.MULTILINE)
    assert {name: float(error) for name, error in stated} == pytest.approx(
        json.loads(result.stdout)["rmse_mps"], abs=0.1
    )
