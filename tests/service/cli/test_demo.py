"""`bentray demo`: the whole path through a real service, small; and its validation of the two results."""

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import httpx
import pytest
from typer.testing import Result

from bentray_service.cli import demo as module

SMALL = ("--nodes", 48, "--elements", 48)


@pytest.mark.slow
def test_the_whole_path_ends_with_bent_rays_ahead_and_a_picture(
    bentray: Callable[..., Result], tmp_path: Path, drawn: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("BENTRAY_WORKERS", "1")
    result = bentray("demo", *SMALL, "-o", tmp_path / "out", "--json")
    assert result.exit_code == 0, result.stderr
    said = json.loads(result.stdout)
    errors = {name: job["truth"]["mean_absolute_error_of_range"] for name, job in said["jobs"].items()}
    assert errors["bent"] < errors["straight"]
    for name, computed in said["jobs"].items():
        shown = f"{100 * errors[name]:.1f} % of range, {computed['truth']['rmse_mps']:.1f} m/s rms"
        assert f"{name.capitalize()}: {shown}" in drawn.words(), "picture and figures agree"
    assert said["jobs"]["straight"]["settings"]["rays"] == "straight"
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
def test_it_fails_in_one_line_when_bent_rays_do_not_win(
    bentray: Callable[..., Result], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(module, "JOBS", {"straight": {"rays": "straight"}, "bent": {"rays": "straight"}})
    result = bentray("demo", *SMALL, "-o", tmp_path)
    assert result.exit_code == 1
    assert "are not better than straight rays" in result.stderr.splitlines()[-1]
    assert "rms error" in result.stdout, "the figures are shown all the same"
