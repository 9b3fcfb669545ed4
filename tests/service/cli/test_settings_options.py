"""The options of a reconstruction give the settings they name, and their help tells the true defaults."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from pathlib import Path
from typing import get_args, get_type_hints

import pytest
from typer.testing import Result

from bentray_kernels.errors import InvalidInput
from bentray_kernels.tomography import Settings
from bentray_service.cli.reconstruct import reconstruct
from bentray_service.cli.settings_options import settings_from
from bentray_service.cli.submit import submit

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
]


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[Settings]:
    """The settings that ``bentray reconstruct`` would have worked with; it then stops."""
    seen: list[Settings] = []

    def stop(**given: object) -> Settings:
        seen.append(settings_from(**given))
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


def test_nothing_given_means_the_defaults_of_the_settings() -> None:
    assert settings_from(rays=None, sweeps=None) == Settings()


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (["--rays", "bent"], "rays: found 'bent'; accepted: one of curved, straight"),
        (["--eikonal", "magic"], "eikonal: found 'magic'; accepted: one of "),
        (["--speed-update", "data-driven"], "speed_range_mps: found None; accepted: (lowest, highest)"),
        (
            ["--speed-range", "1600", "1400"],
            "speed_range_mps: found (1600.0, 1400.0); accepted: (lowest, highest)",
        ),
        (["--relaxation", "2"], "relaxation: found 2.0; accepted: a number between 0 and 2"),
        (["--nodes", "4"], "nodes: found 4; accepted: a number from 16 to 2048"),
        (["--sweeps", "0"], "sweeps: found 0; accepted: a number from 1 to 1000"),
        (["--smoothing", "nan"], "smoothing_nodes: found nan; accepted: a number from 0 to 32"),
        (["--picker", "eye"], "picker: found 'eye'; accepted: one of aic, threshold"),
        (["--side", "-1"], "side_m: found -1.0; accepted: a number from 0.0001 to 100"),
        (["--seed", "-1"], "seed: found -1; accepted: a number from 0"),
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


NAMES = {"side": "side_m", "speed_range": "speed_range_mps", "smoothing": "smoothing_nodes"}


@pytest.mark.parametrize("command", [reconstruct, submit])
def test_the_help_states_the_defaults_that_the_settings_have(command: Callable[..., None]) -> None:
    stated = {}
    for name, hint in get_type_hints(command, include_extras=True).items():
        default = getattr(get_args(hint)[-1], "show_default", None) if get_args(hint) else None
        setting = NAMES.get(name, name)
        if isinstance(default, str) and hasattr(Settings, setting) and getattr(Settings, setting) is not None:
            stated[setting] = default
    assert len(stated) == 11
    assert stated == {name: str(getattr(Settings, name)) for name in stated}
    defaults = [
        p.default for n, p in inspect.signature(command).parameters.items() if NAMES.get(n, n) in stated
    ]
    assert defaults == [None] * 11, "a default of its own would hide that of the settings"
