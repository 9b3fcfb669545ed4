"""The options of a reconstruction give the settings they name, and their help tells the true defaults."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import fields
from pathlib import Path

import pytest
import typer
from hypothesis import given
from hypothesis import strategies as st
from typer.testing import Result

from bentray_kernels.errors import InvalidInput
from bentray_kernels.tomography import Settings
from bentray_service.cli import app
from bentray_service.cli.options.settings_options import OPTIONS, Asked, settings_from

COMMANDS = typer.main.get_command(app).commands  # type: ignore[attr-defined]

# Option, words on the command line, setting, value.
CHOICES = [
    ("--method", ["gauss-newton"], "method", "gauss-newton"),
    ("--rays", ["straight"], "rays", "straight"),
    ("--eikonal", ["fsm"], "eikonal", "fsm"),
    ("--sweeps", ["7"], "sweeps", 7),
    ("--relaxation", ["0.9"], "relaxation", 0.9),
    ("--nodes", ["64"], "nodes", 64),
    ("--side", ["0.25"], "side_m", 0.25),
    ("--speed-range", ["1350", "1600"], "speed_range_mps", (1350.0, 1600.0)),
    ("--smoothing", ["1.5"], "smoothing_nodes", 1.5),
    ("--penalty-strength", ["0.7"], "penalty_strength", 0.7),
    ("--picker", ["threshold"], "picker", "threshold"),
    ("--seed", ["5"], "seed", 5),
    ("--set", ["nodes=64"], "nodes", 64),
    ("--set", ["coarser_grids=2"], "coarser_grids", 2),
    ("--set", ["penalty=laplacian"], "penalty", "laplacian"),
    ("--set", ['picker="threshold"'], "picker", "threshold"),
    ("--set", ["speed_bounds_mps=[1400, 1600]"], "speed_bounds_mps", (1400.0, 1600.0)),
    ("--set", ["stop_rms_s=2e-8"], "stop_rms_s", 2e-8),
    ("--set", ["side_m=null"], "side_m", None),
    ("--set", ["reciprocity=false"], "reciprocity", False),
    ("--set", ["roi=true"], "roi", True),
]


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[Settings]:
    """The settings that ``bentray reconstruct`` would have worked with; it then stops."""
    seen: list[Settings] = []

    def stop(given: Asked) -> Settings:
        seen.append(settings_from(given))
        raise InvalidInput("stop", "here", "nothing")

    monkeypatch.setattr("bentray_service.cli.reconstruct.settings_from", stop)
    return seen


@pytest.mark.parametrize(("option", "words", "name", "value"), CHOICES)
def test_each_option_sets_its_own_setting_and_no_other(
    bentray: Callable[..., Result],
    asked: list[Settings],
    tmp_path: Path,
    option: str,
    words: list[str],
    name: str,
    value: object,
) -> None:
    scan = tmp_path / "scan.h5"
    scan.touch()
    bentray("reconstruct", scan, "-o", tmp_path / "out", option, *words)
    assert asked == [Settings(**{name: value})]  # type: ignore[arg-type]


def test_several_are_taken_together(
    bentray: Callable[..., Result], asked: list[Settings], tmp_path: Path
) -> None:
    (tmp_path / "scan.h5").touch()
    words = ("--set", "coarser_grids=1", "--nodes", 64, "--set", "subset=4")
    bentray("reconstruct", tmp_path / "scan.h5", "-o", tmp_path / "out", *words)
    assert asked == [Settings(coarser_grids=1, nodes=64, subset=4)]


def test_nothing_given_means_the_defaults_of_the_settings() -> None:
    assert settings_from(Asked({})) == Settings()


@pytest.mark.parametrize("field", [field.name for field in fields(Settings)])
def test_every_setting_can_be_set_by_its_name(field: str) -> None:
    default = getattr(Settings(), field)
    assert settings_from(Asked({}, (f"{field}={json.dumps(default)}",))) == Settings()


@given(st.sampled_from(list(OPTIONS)), st.text())
def test_any_text_gives_settings_or_names_the_setting(name: str, text: str) -> None:
    refused = None
    try:
        settings_from(Asked({}, (f"{name}={text}",)))
    except InvalidInput as error:
        refused = error
    assert refused is None or refused.field.partition(".")[0] in (name, "speed_range_mps", "speed_update")


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (["--rays", "bent"], "rays: found 'bent'; accepted: 'curved', 'straight' or"),
        (["--eikonal", "magic"], "eikonal: found 'magic'; accepted: one of "),
        (["--speed-update", "data-driven"], "speed_range_mps: found None; accepted: (lowest, highest)"),
        (
            ["--speed-range", "1600", "1400"],
            "speed_range_mps: found (1600.0, 1400.0); accepted: (lowest, highest)",
        ),
        (["--relaxation", "2"], "relaxation: found 2.0; accepted: a number above 0 and below 2"),
        (["--nodes", "4"], "nodes: found 4; accepted: a number from 16 to 2048"),
        (["--sweeps", "0"], "sweeps: found 0; accepted: a number from 1 to 1000"),
        (["--smoothing", "nan"], "smoothing_nodes: found nan; accepted: a number from 0 to 32"),
        (["--picker", "eye"], "picker: found 'eye'; accepted: 'aic', 'threshold', 'energy-ratio', "),
        (["--side", "-1"], "side_m: found -1.0; accepted: a number from 0.0001 to 100"),
        (["--seed", "-1"], "seed: found -1; accepted: a number from 0"),
        (["--set", "subset=0"], "subset: found 0; accepted: a number from 1 to 4096"),
        (["--set", "subset=many"], "subset: found 'many'; accepted: a valid integer\n"),
        (["--set", "subset=1.5"], "subset: found 1.5; accepted: a valid integer"),
        (["--set", "roi=maybe"], "roi: found 'maybe'; accepted: a valid boolean"),
        (["--set", "penalty=lp"], "penalty: found 'lp'; accepted: 'total-variation', 'laplacian' or"),
        (["--set", "speed_bounds_mps=[1]"], "speed_bounds_mps.1: found nothing; accepted: a value"),
        (["--set", "edge_cost=0.3"], "edge_cost: found 0.3; accepted: a known setting: method, rays, "),
        (["--set", "subset"], "--set: found 'subset'; accepted: NAME=VALUE, e.g. coarser_grids=2"),
        (["--set", "=3"], "--set: found '=3'; accepted: NAME=VALUE"),
        (
            ["--set", "subset=2", "--set", "subset=3"],
            "subset: found two values by --set, the second '3'; accepted: one value",
        ),
        (["--nodes", "64", "--set", "nodes=64"], "nodes: found --nodes and --set nodes=64; accepted: one of"),
    ],
)
@pytest.mark.parametrize("command", ["reconstruct", "submit"])
def test_a_bad_setting_is_one_line_with_field_found_and_accepted(
    bentray: Callable[..., Result], tmp_path: Path, command: str, words: list[str], line: str
) -> None:
    scan = tmp_path / "scan.h5"
    scan.touch()
    result = bentray(command, scan, "-o", tmp_path / "out", *words)
    assert result.exit_code == 2
    assert result.stderr.startswith(f"bentray: {line}")
    assert result.stderr.count("\n") == 1
    assert result.stdout == ""


@pytest.mark.parametrize("command", ["reconstruct", "submit"])
def test_the_help_states_the_defaults_that_the_settings_have(command: str) -> None:
    parameters = {parameter.name: parameter for parameter in COMMANDS[command].params}
    settings = Settings()
    for name, option in OPTIONS.items():
        assert parameters[name].opts == [option.name]
        assert parameters[name].default is None, "a default of its own would hide that of the settings"
        stated = parameters[name].show_default or None
        assert stated == option.default or stated is None
        if getattr(settings, name) is not None:
            assert stated == str(getattr(settings, name)), name
    assert parameters["texts"].opts == ["--set"]
    order = [field.name for field in fields(Settings)]
    assert list(OPTIONS) == sorted(OPTIONS, key=order.index), "in the order of the settings"
