"""A setting changes the result exactly where it is declared to have an effect, and is refused elsewhere."""

from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from bentray_kernels.acquisition import Dataset, Truth, Waveform
from bentray_kernels.errors import InvalidInput
from bentray_kernels.requests.request_fields import check_used, declared, unused
from bentray_kernels.tomography import Reconstruction, Settings, reconstruct
from bentray_kernels.tomography.device_choice import ScanSize, device_work

from ..straight_scans import chords_m, ring_scan

# Another value of each setting. A new setting must have one here.
SAMPLES: Mapping[str, Any] = {
    "rays": "straight", "eikonal": "fmm", "opening_angle_deg": 60.0, "water_temperature_c": 30.0,
    "nodes": 26, "side_m": 0.09, "iterations": 1, "speed_bounds_mps": (1490.0, 1520.0), "roi": True,
    "resolution_check": True, "uncertainty": True, "minutes": 1.0, "penalty_strength": 0.05,
    "picker": "threshold", "attenuation": False, "amplitudes": "ratio", "reflection": True,
}  # fmt: skip
# Of the pipeline of files: whether travel times are examined. Of the array: one of a single height has
# slices. Of the machine: the device. The method is part of every case.
ELSEWHERE = {"method", "examine", "max_left_out", "decomposition", "device"}
CASES: Mapping[str, dict[str, Any]] = {
    "SART": {"method": "sart", "reflection": True},
    "SART, straight rays": {"method": "sart", "rays": "straight"},
    "SART, speed alone": {"method": "sart", "attenuation": False},
    "Gauss-Newton": {"method": "gauss-newton"},
    "Gauss-Newton, straight rays": {"method": "gauss-newton", "rays": "straight", "uncertainty": True},
    "Gauss-Newton, no penalty": {"method": "gauss-newton", "penalty_strength": 0.0, "attenuation": False},
}
ELEMENTS, RADIUS, WATER, MIDDLE_HZ, SAMPLING_HZ = 12, 0.03, 1500.0, 3e5, 3e6


@cache
def scan() -> Dataset:
    """A disc in a ring: travel times, amplitudes, traces, directions of elements and a region of interest."""
    water = ring_scan(ELEMENTS, RADIUS)
    chord, length = chords_m(water, 0.012, (0.006, 0.003)), water.distance_m()
    noise = np.random.default_rng(0).normal(0.0, 2e-9, chord.shape)
    delta, loss = chord * (1.0 / 1580.0 - 1.0 / WATER) + noise, 12.0 * chord
    time = np.arange(192) / SAMPLING_HZ - (length / WATER)[..., None]

    def pulses(late: np.ndarray, lost: np.ndarray) -> np.ndarray:
        t = time - late[..., None]
        return np.exp(-lost)[..., None] * np.cos(2e6 * t) * np.exp(-((t / 3e-6) ** 2))

    roi = np.zeros((30, 30), dtype=bool)
    roi[10:25, 10:25] = True
    truth = Truth(np.full((30, 30), WATER), (0.002, 0.002), (-0.029, -0.029), axes="x,y")
    traces = Waveform(pulses(delta, loss), pulses(0.0 * delta, 0.0 * loss))
    return ring_scan(
        ELEMENTS, RADIUS, delta, WATER, log_ratio_np=loss, waveform=traces, roi=roi, truth=truth,
        element_normal=-water.element_position_m / RADIUS, center_frequency_hz=MIDDLE_HZ, radius_m=RADIUS,
        sampling_rate_hz=SAMPLING_HZ, amplitude_frequency_hz=MIDDLE_HZ, water_temperature_c=26.0,
    )  # fmt: skip


def arrays(result: Reconstruction) -> list[bytes]:
    reflection = None if result.reflection is None else result.reflection.db
    held = (result.speed, result.attenuation, result.recovery, result.uncertainty, reflection)
    return [b"" if one is None else one.tobytes() for one in held]


def test_every_setting_has_a_case() -> None:
    assert declared(Settings).keys() == SAMPLES.keys() | ELSEWHERE


@pytest.mark.parametrize("case", CASES)
def test_a_setting_changes_the_result_where_it_has_an_effect(case: str) -> None:
    facts = {"scan_amplitudes": True, "scan_traces": False, "scan_picks": False}
    base = Settings.from_values(nodes=24, iterations=4, device="cpu", pixel_m=0.004).changed(**CASES[case])
    usual, idle = arrays(reconstruct(scan(), base)), {}
    for name, place in ((name, declared(Settings)[name].place) for name in SAMPLES):
        # Gauss-Newton estimates the uncertainty unless it is told not to.
        value = not base.estimates_uncertainty if name == "uncertainty" else SAMPLES[name]
        settings = base.changed(**{name: value})
        if settings == base or (name == "attenuation" and not base.attenuation.enabled):
            continue
        if place not in unused(settings, facts):
            assert arrays(reconstruct(scan(), settings)) != usual, name
            continue
        idle[name] = value
        if place in unused(settings):
            with pytest.raises(InvalidInput, match=f"^{place}: found .*; accepted: .*, unless "):
                check_used(settings)
    together = base.changed(**idle)
    assert unused(together, facts).keys() == {declared(Settings)[name].place for name in idle}
    assert arrays(reconstruct(scan(), together)) == usual, idle


def test_a_device_is_refused_where_nothing_is_computed_on_it() -> None:
    """The rule ``device_work`` decides what is computed on devices."""
    size = ScanSize(1, 12, 12, 192)
    cases = [one | {"minutes": None} for one in CASES.values()]
    cases += [{"method": method} for method in ("auto", "waveform")]
    cases += [{"method": "sart", "eikonal": "fmm"}, {"method": "sart", "decomposition": "volume"}]
    cases += [
        {"method": "auto", "decomposition": "volume"},
        {"method": "auto", "minutes": 3.0, "eikonal": "fmm"},
    ]
    for case in cases:
        settings = Settings.from_values(nodes=20).changed(**case)
        used = device_work(size, settings) is not None
        assert ("device" not in unused(settings.changed(device="opencl"))) == used, case
        assert "device" not in unused(settings.changed(device="cpu"))


@pytest.mark.parametrize("method", ["auto", "gauss-newton"])
def test_a_result_lists_settings_without_effect_on_it(method: str) -> None:
    """On a scan with times and without amplitudes, and by what ``auto`` chose."""
    bare = replace(scan(), log_ratio_np=None, waveform=None, center_frequency_hz=None)
    asked = {"picker": "threshold", "penalty_strength": 0.02, "iterations": 3}
    result = reconstruct(bare, check_used(Settings.from_values(method=method, nodes=20, **asked)))
    text = result.caution("settings")
    assert "picking.picker, unless travel times are picked from traces" in text
    if method == "auto":
        replaced = f"gauss_newton.penalty_strength 0.02 by {result.settings.gauss_newton.penalty_strength}"
        if result.settings.method == "sart":
            assert "gauss_newton.penalty_strength, unless method is gauss-newton" in text
        else:
            assert (replaced in text) == (result.settings.gauss_newton.penalty_strength != 0.02)
    assert not result.doubt
    plain = reconstruct(bare, Settings.from_values(method="sart", nodes=20, iterations=3))
    assert plain.caution("settings") == ""
