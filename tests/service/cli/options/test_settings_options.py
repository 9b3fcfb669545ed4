"""Options of a reconstruction set the settings of the same name, and their help shows the true defaults."""

from pathlib import Path

import pytest
import typer

from bentray_kernels.errors import InvalidInput
from bentray_kernels.tomography.settings import PLACES, Settings
from bentray_service.cli import app
from bentray_service.cli.options.option_tables import SETTINGS_OPTIONS, settings_from

from ..conftest import Run

COMMANDS = typer.main.get_command(app).commands  # type: ignore[attr-defined]

# Words on the command line, setting by its own name, value.
CHOICES = [
    (["--method", "gauss-newton"], "method", "gauss-newton"),
    (["--rays", "straight"], "rays", "straight"),
    (["--eikonal", "fsm"], "eikonal", "fsm"),
    (["--decomposition", "volume"], "decomposition", "volume"),
    (["--opening-angle", "60"], "opening_angle_deg", 60.0),
    (["--water-temperature", "31.5"], "water_temperature_c", 31.5),
    (["--nodes", "64"], "nodes", 64),
    (["--side", "0.25"], "side_m", 0.25),
    (["--iterations", "7"], "iterations", 7),
    (["--speed-bounds", "1400", "1600"], "speed_bounds_mps", (1400.0, 1600.0)),
    (["--roi"], "roi", True),
    (["--device", "opencl"], "device", "opencl"),
    (["--resolution-check"], "resolution_check", True),
    (["--uncertainty"], "uncertainty", True),
    (["--minutes", "2.5"], "minutes", 2.5),
    (["--penalty-strength", "0.7"], "penalty_strength", 0.7),
    (["--picker", "threshold"], "picker", "threshold"),
    (["--no-examine"], "examine", False),
    (["--max-left-out", "0.5"], "max_left_out", 0.5),
    (["--no-attenuation"], "attenuation", False),
    (["--amplitudes", "ratio"], "amplitudes", "ratio"),
    (["--reflection"], "reflection", True),
]


@pytest.fixture
def received(monkeypatch: pytest.MonkeyPatch) -> list[Settings]:
    """The settings that ``bentray reconstruct`` would have worked with; it then stops."""
    seen: list[Settings] = []

    def stop(given: dict[str, object]) -> Settings:
        seen.append(settings_from(given))
        raise InvalidInput("stop", "here", "nothing")

    monkeypatch.setattr("bentray_service.cli.reconstruct.settings_from", stop)
    return seen


@pytest.mark.parametrize(("words", "name", "value"), CHOICES)
def test_each_option_sets_its_own_setting_and_no_other(
    bentray: Run,
    received: list[Settings],
    tmp_path: Path,
    words: list[str],
    name: str,
    value: object,
) -> None:
    scan = tmp_path / "scan.h5"
    scan.touch()
    bentray("reconstruct", scan, "-o", tmp_path / "out", *words, code=2)
    assert received == [Settings.from_values(**{name: value})]


def test_several_are_taken_together(bentray: Run, received: list[Settings], tmp_path: Path) -> None:
    (tmp_path / "scan.h5").touch()
    words = ("--iterations", 2, "--nodes", 64, "--penalty-strength", 2)
    bentray("reconstruct", tmp_path / "scan.h5", "-o", tmp_path / "out", *words, code=2)
    assert received == [Settings.from_values(iterations=2, nodes=64, penalty_strength=2.0)]


def test_every_setting_has_its_option() -> None:
    assert list(SETTINGS_OPTIONS) == list(PLACES) == [name for _, name, _ in CHOICES]


def test_no_options_give_default_settings() -> None:
    assert settings_from({}) == Settings()


@pytest.mark.parametrize("command", ["reconstruct", "submit"])
def test_the_help_states_the_defaults_that_the_settings_have(command: str) -> None:
    parameters = {parameter.name: parameter for parameter in COMMANDS[command].params}
    for name, option in SETTINGS_OPTIONS.items():
        assert [*parameters[name].opts, *parameters[name].secondary_opts] == option.name.split("/")
        assert parameters[name].default is None, "a default of its own would hide that of the settings"
        record, _, leaf = PLACES[name].rpartition(".")
        default = getattr(getattr(Settings(), record) if record else Settings(), leaf)
        if isinstance(default, bool):
            default = "yes" if default else "no"
        elif isinstance(default, tuple):
            default = " ".join(map(str, default))
        assert parameters[name].show_default == option.default
        assert default is None or option.default == str(default), name


def test_the_unit_of_a_range_keeps_its_letters() -> None:
    assert "A number from 0 to 95 °C." in SETTINGS_OPTIONS["water_temperature_c"].help
