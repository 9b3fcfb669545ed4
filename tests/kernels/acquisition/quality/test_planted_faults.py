"""Faults planted in simulated waves: each is found, named, and survived or refused with a reason."""

from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bentray_kernels.acquisition import Dataset, Waveform
from bentray_kernels.acquisition.calibration import calibrate, water_times
from bentray_kernels.acquisition.quality import Examined, Finding, examine
from bentray_kernels.acquisition.quality.chords import _log_ratio
from bentray_kernels.acquisition.quality.correction import apply
from bentray_kernels.acquisition.quality.element_errors import _robust_fit
from bentray_kernels.acquisition.quality.polarity import MIN_PAIRS, _majority
from bentray_kernels.acquisition.quality.swapped import _exchanged
from bentray_kernels.acquisition.quality.time_zero import find_time_shift
from bentray_kernels.acquisition.simulation.ring_scan import Ring
from bentray_kernels.wave.medium import Medium
from bentray_kernels.wave.simulation import simulate

from ...straight_scans import ring_scan
from ..traces import later

ELEMENTS, RADIUS_M, WATER_MPS, FREQUENCY_HZ = 32, 0.024, 1500.0, 4e5
# Seven nodes in a wave and 32 steps in a period: the water is as good as free of dispersion.
SPACING_M, HALF, STEP_S, SKIP, STEPS = 5e-4, 52, 7.8125e-8, 4, 640
START_S, NOISE = -2.5 / FREQUENCY_HZ, 0.01
RATE_HZ = 1.0 / (STEP_S * SKIP)
LATE_S = 4.0e-7

# Element pairs whose traces of the object stand still or hold no number, and of the water.
CONSTANT, INFINITE, NAN = ([2, 15], [9, 30]), ([5], [21]), ([28], [12])


@cache
def wave_scan() -> Dataset:
    """float32 traces of two blobs, one slow and one fast, with noise of a hundredth of the usual pulse."""
    axis = SPACING_M * np.arange(-HALF, HALF + 1)
    x, y = np.meshgrid(axis, axis, indexing="ij")
    water = np.full_like(x, WATER_MPS)
    blobs = water - 50.0 * np.exp(-(((x**2 + (y + 0.003) ** 2) / 0.008**2) ** 2))
    blobs += 60.0 * np.exp(-(((x - 0.003) ** 2 + (y - 0.006) ** 2) / 0.003**2))
    position = Ring(ELEMENTS, RADIUS_M).positions()
    late = (START_S + STEP_S * np.arange(STEPS)) * FREQUENCY_HZ
    pulse = np.exp(-((0.9 * late) ** 2)) * np.sin(2.0 * np.pi * late)
    random = np.random.default_rng(5)

    def traces(speed: np.ndarray) -> np.ndarray:
        medium, at = Medium.from_speed(speed, SPACING_M, STEP_S, edge_nodes=20), position + SPACING_M * HALF
        clean = np.stack([simulate(medium, source, at, pulse)[:, ::SKIP] for source in at])
        usual = float(np.median(np.abs(clean).max(axis=-1)))
        return (clean / usual + NOISE * random.standard_normal(clean.shape)).astype(np.float32)

    every = np.arange(ELEMENTS)
    return Dataset(
        position,
        every,
        every,
        WATER_MPS,
        waveform=Waveform(traces(blobs), traces(water)),
        center_frequency_hz=FREQUENCY_HZ,
        sampling_rate_hz=RATE_HZ,
        t0_s=START_S,
    )


@pytest.fixture(scope="module")
def sought() -> np.ndarray:
    """Times of the scan without faults, (ntx, nrx), s."""
    examined = examine(wave_scan())
    assert examined.report.verdict == "clean"
    assert examined.picked is not None
    delta = examined.picked.differential_tof()
    assert np.isfinite(delta).mean() > 0.85
    return delta


def found(examined: Examined, check: str) -> list[Finding]:
    return [finding for finding in examined.report.findings if finding.check == check]


class Planted:
    """A scan with all faults that one scan may have: in some elements, and in one pair of twenty, of which
    the object's pulse is moved by a period or more."""

    def __init__(self, elements: list[int], roles: tuple[str, ...], seed: int) -> None:
        self.dead, self.swapped, self.inverted = sorted(elements[:3]), elements[3:5], elements[5]
        self.roles = roles
        random = np.random.default_rng(seed)
        received, water = (t.copy() for t in (wave_scan().waveform.object, wave_scan().waveform.water))
        received = later(received, LATE_S, RATE_HZ)
        pairs = np.argwhere(~np.eye(ELEMENTS, dtype=bool))
        self.moved = np.zeros((ELEMENTS, ELEMENTS), dtype=bool)
        for e, r in pairs[random.permutation(len(pairs))[: len(pairs) // 20]]:
            self.moved[e, r] = True
            periods = random.choice([-1.0, 1.0]) * random.choice([1.0, 1.7, 2.4])
            received[e, r] = later(received[e, r], periods / FREQUENCY_HZ, RATE_HZ)
        order = np.arange(ELEMENTS)
        order[self.swapped] = order[self.swapped[::-1]]
        for traces in (received, water):
            traces[:] = traces[order][:, order]
            for role in roles:
                traces[self.inverted if role == "emission" else (slice(None), self.inverted)] *= -1.0
            noise = NOISE * random.standard_normal(traces.shape)
            traces[self.dead], traces[:, self.dead] = noise[self.dead], noise[:, self.dead]
            np.clip(traces, -0.7, 0.7, out=traces)
        received[CONSTANT], received[INFINITE], water[NAN] = 0.5, np.inf, np.nan
        self.dataset: Dataset = replace(wave_scan(), waveform=Waveform(received, water))


@given(
    elements=st.lists(st.integers(0, ELEMENTS - 1), min_size=6, max_size=6, unique=True),
    roles=st.sampled_from([("emission",), ("reception",), ("emission", "reception")]),
    seed=st.integers(0, 2**32 - 1),
)
@settings(max_examples=5, deadline=None)
def test_all_faults_together_are_found_and_corrected(sought, elements, roles, seed):
    planted = Planted(elements, roles, seed)
    examined = examine(planted.dataset)
    dead, swapped = set(planted.dead), set(planted.swapped)
    both = ["emission", "reception"]
    assert [(f.elements, f.role, f.action) for f in found(examined, "dead elements")] == [
        (tuple(planted.dead), role, "left out") for role in both
    ]
    told = found(examined, "swapped channels")
    assert sorted((f.role, set(f.elements), f.action) for f in told) == [
        (role, swapped, "corrected") for role in both
    ]
    assert [(f.elements, f.role, f.action) for f in found(examined, "polarity")] == [
        ((planted.inverted,), role, "corrected") for role in roles
    ]
    (offset,) = found(examined, "time zero of the object scan")
    assert offset.action == "corrected"
    assert offset.value == pytest.approx(LATE_S, abs=3e-8)
    for check, places in (("constant traces", [CONSTANT]), ("values", [INFINITE, NAN])):
        silent = {(e, r) for place in places for e, r in zip(*place, strict=True) if not dead & {e, r}}
        pairs = [pair for finding in found(examined, check) for pair in np.argwhere(finding.pairs).tolist()]
        assert sorted(map(tuple, pairs)) == sorted(silent)
    assert {f.action for f in found(examined, "clipping")} == {"reported"}
    assert any("gain is too high" in f.found for f in found(examined, "clipping"))
    assert examined.picked is not None
    delta = examined.picked.differential_tof()
    assert np.isnan(delta[planted.dead]).all()
    assert np.isnan(delta[:, planted.dead]).all()
    alive = np.isfinite(sought)
    alive[planted.dead] = alive[:, planted.dead] = False
    left = np.isnan(delta)
    assert left[alive & planted.moved].mean() > 0.7
    assert left[alive & ~planted.moved].mean() < 0.03
    off = np.abs((delta - sought)[alive & ~left])
    assert np.mean(off > 0.1 / FREQUENCY_HZ) < 0.01
    assert np.median(off) < 4e-8
    jumps, outliers = (found(examined, check) for check in ("cycle jumps", "outliers"))
    assert jumps
    assert outliers


def test_truncated_pulses_do_not_bias_the_water_speed():
    """Places that are wrong a little leave room for such crests in the line, which then leans by 3 %."""
    clipped = (np.clip(t, -0.7, 0.7) for t in (wave_scan().waveform.object, wave_scan().waveform.water))
    angle = 2.0 * np.pi * np.arange(ELEMENTS) / ELEMENTS
    off = 4e-4 * np.column_stack((np.cos(2.0 * angle), np.zeros(ELEMENTS)))
    position = wave_scan().element_position_m + off
    examined = examine(replace(wave_scan(), waveform=Waveform(*clipped), element_position_m=position))
    assert [f.check for f in examined.report.findings] == ["clipping", "clipping", "element positions"]


@pytest.mark.parametrize(
    ("changes", "check", "reason"),
    [
        ({"sampling_rate_hz": 0.9 * RATE_HZ}, "sampling rate", "sampling rate, element positions or"),
        ({"sampling_rate_hz": 1.25 * RATE_HZ}, "sampling rate", "arrivals in water at"),
        ({"center_frequency_hz": None}, "centre frequency", "none"),
    ],
)
def test_rejects_faults_that_cannot_be_corrected(changes, check, reason):
    examined = examine(replace(wave_scan(), **changes))
    assert examined.picked is None
    assert examined.report.refusal.check == check
    assert reason in examined.report.refusal.found
    assert examined.report.refusal.accepted


def test_an_eccentricity_of_a_millimetre_is_named_survived_and_calibrated(sought):
    angle = 2.0 * np.pi * np.arange(ELEMENTS) / ELEMENTS
    true = wave_scan().element_position_m
    drawn = true + 1e-3 * np.column_stack((np.cos(2.0 * angle), np.zeros(ELEMENTS)))
    dataset = replace(wave_scan(), element_position_m=drawn)
    examined = examine(dataset)
    (finding,) = examined.report.findings
    assert (finding.check, finding.action) == ("element positions", "reported")
    assert 5e-4 < finding.value < 1.2e-3
    delta = examined.picked.differential_tof()
    assert np.isfinite(delta[np.isfinite(sought)]).mean() > 0.98
    assert np.nanmax(np.abs(delta - sought)) < 1e-7
    put_right = apply(dataset, examined.report.findings)
    fitted = calibrate(put_right, water_times(put_right)).element_position_m
    assert np.median(np.linalg.norm(fitted - true, axis=1)) < 0.2 * np.median(
        np.linalg.norm(drawn - true, axis=1)
    )
    assert not found(examine(replace(dataset, element_position_m=fitted)), "element positions")


def test_a_swap_is_reported_with_the_larger_deviation_of_the_two():
    random = np.random.default_rng(0)
    expected = random.uniform(-2e-6, 2e-6, (24, 6))
    times = expected.copy()
    times[:, 4], times[:, 1] = expected[:, 1], expected[:, 4] + 1e-9
    own = [np.median(np.abs(times[:, k] - expected[:, k])) for k in (1, 4)]
    for order in (slice(None), slice(None, None, -1)):
        ((_, _, deviation),) = _exchanged(times[:, order], expected[:, order], 2e-7)
        assert deviation == pytest.approx(max(own))
    assert own[0] != own[1]


def test_as_many_pairs_as_needed_decide_about_the_polarity():
    sign = np.full((2, MIN_PAIRS + 2), np.nan)
    sign[0, :MIN_PAIRS], sign[1, : MIN_PAIRS - 1] = -1.0, -1.0
    np.testing.assert_array_equal(_majority(sign, 1), [-1.0, 1.0])
    np.testing.assert_array_equal(_majority(sign.T, 0), [-1.0, 1.0])


def test_the_deviation_of_a_fit_is_that_of_repeated_fits():
    random = np.random.default_rng(0)
    rows = random.normal(size=(60, 3))
    fits = [_robust_fit(rows, rows @ (1.0, -2.0, 0.5) + random.normal(size=60)) for _ in range(200)]
    solutions, sigmas = (np.array(part) for part in zip(*fits, strict=True))
    np.testing.assert_allclose(solutions.mean(axis=0), [1.0, -2.0, 0.5], atol=0.05)
    np.testing.assert_allclose(sigmas.mean(axis=0), solutions.std(axis=0), rtol=0.3)


def test_amplitudes_are_freed_of_distance_emitter_and_receiver():
    random = np.random.default_rng(0)
    distance = random.uniform(0.05, 0.2, (3, 5))
    gain = random.uniform(0.1, 10.0, (3, 1)) * random.uniform(0.1, 10.0, 5)
    peak = gain / np.sqrt(distance)
    peak[1, 2], peak[2, 0] = 0.0, np.nan
    dataset = SimpleNamespace(distance_m=lambda: distance, valid=None)
    ratio = _log_ratio(dataset, SimpleNamespace(peak=peak))
    np.testing.assert_array_equal(np.isnan(ratio), ~(peak > 0.0))
    np.testing.assert_allclose(ratio[np.isfinite(ratio)], 0.0, atol=1e-6)


@pytest.mark.parametrize(
    ("shift_s", "scatter_s", "along_s_m", "found"),
    [
        (1.9e-7, 0.0, 0.0, []),
        (2.1e-7, 0.0, 0.0, [("corrected", "pairs)")]),
        (3.2e-5, 0.0, 0.0, [("corrected", "pairs)")]),
        (3.4e-5, 0.0, 0.0, [("refused", "more than a wrong time zero can be (33.3 µs")]),
        (1e-5, 5e-6, 0.0, [("reported", "scatter by")]),
        (0.0, 0.0, 4e-5, [("reported", "grow with the distance")]),
        (0.0, 1e-5, 0.0, []),
    ],
)
def test_an_offset_is_corrected_only_if_it_can_be_a_time_zero(shift_s, scatter_s, along_s_m, found):
    """Pairs that miss the object, at 500 kHz in a ring 0.2 m wide, which sound crosses in 133 µs."""
    dataset = ring_scan(64, 0.1, center_frequency_hz=5e5)
    noise = np.random.default_rng(0).normal(0.0, scatter_s, (64, 64))
    findings = [*find_time_shift(dataset, shift_s + noise + along_s_m * dataset.distance_m())]
    assert [one.action for one in findings] == [action for action, _ in found]
    assert all(words in one.found for one, (_, words) in zip(findings, found, strict=True))
    few = np.where(np.arange(64) < 5, shift_s, np.nan)[:, None] * np.where(np.arange(64) == 5, 1.0, np.nan)
    assert not [*find_time_shift(dataset, few)]
