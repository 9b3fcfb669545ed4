"""k-Wave against our simulator on a tiny grid, without network access; skipped where it is not installed."""

import importlib.util
import urllib.request
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from benchmarks.waves._kwave_peer import installed, mass
from benchmarks.waves._wave_shots import Shot, delays, misfit, pulse

SHOT = Shot("water", 4.5, 0.012, receivers=7)


def programs() -> list[Path]:
    """Files where k-Wave keeps the programs that it downloads."""
    spec = importlib.util.find_spec("kwave")
    points = spec.submodule_search_locations if spec is not None else None
    return [path for place in points or () for path in Path(place, "bin").rglob("*")]


def test_its_source_is_the_integral_of_ours() -> None:
    step, speed, spacing = 2.5e-8, 1500.0, 5e-4
    time = step * np.arange(-280, 400)
    result = np.zeros(time.size)
    sent = mass(pulse(time), step, speed, spacing)
    result[: sent.size] = sent
    # In the middle between two time steps, so that the difference is the rate at the later one.
    rate = np.diff(result, prepend=0.0) / step
    assert np.abs(rate - 0.5 * speed / spacing * pulse(time)).max() < 2e-3 * rate.max()
    assert sent.size < 0.85 * time.size


@pytest.mark.parametrize("late", [-3.3, 0.4, 5.25])
def test_delays_are_those_that_were_planted(late: float) -> None:
    time = 1e-7 * np.arange(400)
    first, other = (pulse(time - 1.5e-5 - shift)[None] for shift in (1e-7 * late, 0.0))
    assert delays(first, other, 1e-7)[0] == pytest.approx(1e-7 * late, abs=2e-10)


def test_the_budget_is_what_the_step_of_time_does_to_ours() -> None:
    """A grid so fine that a pulse is late by its time step alone."""
    shot = Shot("water", 12.0, 0.012, receivers=7)
    relative = (np.pi * 5e5 * shot.step) ** 2 / 6.0
    assert shot.lateness(1500.0) == pytest.approx(-relative * shot.distance / 1500.0, rel=0.05)


@pytest.mark.parametrize("name", ["water", "breast with loss"])
def test_kwave_gives_our_traces_but_for_the_stated_dispersion(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(*_: object) -> None:
        raise AssertionError("something is fetched")

    before = programs()
    monkeypatch.setattr(urllib.request, "urlretrieve", refused)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # a peer's own are its own affair
        peers, missing = installed()
        if missing:
            pytest.skip(missing["k-Wave"])
        shot = replace(SHOT, name=name)
        theirs = shot.theirs(peers["k-Wave"])
    stated, _ = shot.budget(theirs)
    assert misfit(shot.ours(), theirs) == pytest.approx(stated, rel=0.1)
    assert misfit(*shot.as_a_refinement(theirs)) < 0.01
    assert programs() == before
