"""Units and times that cannot be are refused by name or missing; real and rough scans are taken."""

from dataclasses import replace

import numpy as np
import pytest

from bentray_kernels import eikonal
from bentray_kernels.acquisition import Waveform
from bentray_kernels.acquisition.plausibility import check_plausible
from bentray_kernels.acquisition.quality import examine
from bentray_kernels.errors import InvalidInput
from bentray_kernels.rays import trace
from bentray_kernels.splines.prefilter import prefilter
from bentray_kernels.tomography import rmse
from bentray_kernels.wave.medium import Medium

from ..straight_scans import ring_scan
from .test_arrangement import on_ring, scan

POSITION, DELTA = "geometry/element_position_m", "traveltime/delta_tof_s"


def ring(elements=32, radius_m=0.1, **changes):
    made = ring_scan(elements, radius_m)
    distance = made.distance_m()
    return replace(
        made, tof_s=distance / 1520.0, delta_tof_s=distance / 1520.0 - distance / 1500.0, **changes
    )


def times_only(scan, name, factor=1.0):
    other = {"tof_s": "delta_tof_s", "delta_tof_s": "tof_s"}[name]
    return replace(scan, **{name: factor * getattr(scan, name), other: None})


@pytest.mark.parametrize("radius_m", [1.01e-3, 0.01, 0.1, 0.25, 1.99])
def test_rings_of_every_size_are_taken(radius_m):
    check_plausible(ring(radius_m=radius_m))


@pytest.mark.parametrize(
    ("unit", "factor"), [("cm", 1e2), ("mm", 1e3), ("µm", 1e6), ("nm", 1e9), ("km", 1e-3)]
)
def test_positions_in_another_unit(unit, factor):
    scan = ring()
    with pytest.raises(InvalidInput, match=f"these positions look like {unit}: write m") as refusal:
        check_plausible(replace(scan, element_position_m=factor * scan.element_position_m))
    assert refusal.value.field == POSITION


@pytest.mark.parametrize("name", ["tof_s", "delta_tof_s"])
@pytest.mark.parametrize(("unit", "factor"), [("ms", 1e3), ("µs", 1e6), ("ns", 1e9)])
def test_times_in_another_unit(name, unit, factor):
    with pytest.raises(InvalidInput, match=f"these times look like {unit}: write s") as refusal:
        check_plausible(times_only(ring(), name, factor))
    assert refusal.value.field == f"traveltime/{name}"


@pytest.mark.parametrize("speed_mps", [1350.0, 1500.0, 1650.0])
def test_arrival_times_in_place_of_differences(speed_mps):
    scan = times_only(ring(), "delta_tof_s")
    arrivals = scan.distance_m() / speed_mps
    with pytest.raises(InvalidInput, match="look like arrivals: write them to traveltime/tof_s") as refusal:
        check_plausible(replace(scan, delta_tof_s=arrivals))
    assert refusal.value.field == DELTA


@pytest.mark.parametrize("speed_mps", [1000.0, 1350.0, 2700.0])
def test_differences_of_slow_and_fast_objects_are_taken(speed_mps):
    scan = times_only(ring(), "delta_tof_s")
    check_plausible(replace(scan, delta_tof_s=scan.distance_m() * (1.0 / speed_mps - 1.0 / 1500.0)))


@pytest.mark.parametrize("time", [-1.0, 1e300, -1e300, 0.0, 5e-324, 1e-9])
def test_rejects_implausible_times(time):
    with pytest.raises(InvalidInput, match=r"sound that runs at 300 to 6000 m/s"):
        check_plausible(replace(ring(), tof_s=np.full((32, 32), time)))
    if abs(time) > 1e-6:
        with pytest.raises(InvalidInput, match=r"sound that runs at 300 to 6000 m/s"):
            check_plausible(replace(ring(), tof_s=None, delta_tof_s=np.full((32, 32), time)))


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"element_position_m": np.zeros((32, 2))}, POSITION),
        ({"element_position_m": np.full((32, 2), 1e300)}, POSITION),
        ({"element_position_m": 1.7e308 * ring().element_position_m}, POSITION),
        ({"element_position_m": 1000.0 + ring().element_position_m}, POSITION),
        ({"radius_m": 100.0}, "geometry@radius_m"),
        ({"sigma_s": np.full((32, 32), 1.0)}, "traveltime/sigma_s"),
        ({"sigma_s": np.full((32, 32), 5e-324)}, None),
        ({"log_ratio_np": np.full((32, 32), -1e300)}, "amplitude/log_ratio_np"),
        ({"wavelet": np.array([0.0, 1e300])}, "acquisition/wavelet"),
    ],
)
def test_rejects_implausible_numbers(change, field):
    scan = replace(ring(), **change)
    if field is None:
        check_plausible(scan)
        return
    with pytest.raises(InvalidInput, match=f"^{field}: found"):
        check_plausible(scan)


def test_rough_scans_are_taken():
    random = np.random.default_rng(0)
    scan = ring()
    # A third of the picks anywhere in the record, most of the pairs missing or invalid, nothing at all.
    rough = np.where(random.random((32, 32)) < 0.3, random.uniform(0.0, 1e-3, (32, 32)), scan.tof_s)
    check_plausible(replace(scan, tof_s=rough))
    check_plausible(replace(scan, tof_s=np.where(random.random((32, 32)) < 0.95, np.nan, scan.tof_s)))
    check_plausible(replace(scan, tof_s=np.full((32, 32), np.nan)))
    bad = random.random((32, 32)) < 0.9
    check_plausible(replace(scan, tof_s=np.where(bad, 0.05, scan.tof_s), valid=~bad))


def test_slices_are_checked_alike():
    scan = ring()
    stacked = replace(
        scan,
        slice_z_m=np.linspace(0.0, 0.1, 20),
        tof_s=np.repeat(scan.tof_s[None], 20, axis=0),
        delta_tof_s=np.repeat(scan.delta_tof_s[None], 20, axis=0),
    )
    check_plausible(stacked)
    with pytest.raises(InvalidInput, match="look like µs"):
        check_plausible(replace(stacked, tof_s=1e6 * stacked.tof_s))
    with pytest.raises(InvalidInput, match="these heights look like mm"):
        check_plausible(replace(stacked, slice_z_m=1e3 * stacked.slice_z_m))


RIGHT = scan(on_ring(32), of="large")
OTHER = ~np.eye(32, dtype=bool)
FAILED = OTHER & (np.random.default_rng(0).random((32, 32)) < 0.08)
PLACEHOLDERS = (
    -1.0, -99.0, -999.0, -9999.0, 1e20, 1e30, 99999.0, np.inf, -np.inf, np.nan,
    float(np.iinfo(np.int32).min), float(np.iinfo(np.int64).max),
    # Those converted from µs.
    -1e-6, -9.999e-3, 9.999e-3, 0.099999,
)  # fmt: skip


def with_times(name, times):
    return replace(RIGHT, **{"tof_s": None, "delta_tof_s": None, name: times})


@pytest.mark.parametrize("value", [0.0, *PLACEHOLDERS])
@pytest.mark.parametrize("name", ["tof_s", "delta_tof_s"])
def test_what_stands_for_a_missing_time_is_missing_and_counted(name, value):
    right = getattr(RIGHT, name)
    dataset = with_times(name, np.where(FAILED, value, right))
    times = getattr(dataset, name)
    counted = sum(dataset.impossible_times.values())
    if name == "delta_tof_s" and value == 0.0:
        # Where the other direction is missing as well, or no object was crossed, nothing contradicts 0.
        contradicted = FAILED & ~FAILED.T & (right != 0.0)
        np.testing.assert_array_equal(np.isnan(times), contradicted)
        assert counted == contradicted.sum()
        return
    if name == "delta_tof_s" and value == -1e-6:
        # A difference as any other.
        return
    np.testing.assert_array_equal(np.isnan(times), FAILED)
    np.testing.assert_array_equal(times[~FAILED], right[~FAILED])
    assert counted == (0 if np.isnan(value) else FAILED.sum())
    check_plausible(dataset)
    # Nothing more is found in what is left.
    assert replace(dataset, title="again").impossible_times == dataset.impossible_times


@pytest.mark.parametrize("name", ["tof_s", "delta_tof_s"])
@pytest.mark.parametrize("half", [np.triu, np.tril])
def test_zeros_of_half_a_matrix_are_missing(name, half):
    dataset = with_times(name, half(getattr(RIGHT, name)))
    given = half(np.ones((32, 32), dtype=bool), 1 if half is np.triu else -1)
    times = getattr(dataset, name)
    empty = OTHER & ~given & (getattr(RIGHT, name) != 0.0)
    assert np.isnan(times[empty]).all()
    np.testing.assert_array_equal(times[given], getattr(RIGHT, name)[given])
    assert dataset.impossible_times == {"zero where the other direction is not": empty.sum()}
    check_plausible(dataset)
    assert examine(dataset).report.verdict == "usable"


def test_right_times_stay():
    random = np.random.default_rng(1)
    delta = RIGHT.delta_tof_s
    quantised = 8e-8 * np.round(delta / 8e-8) + 8e-8 * (random.random(delta.shape) < 0.05)
    assert with_times("delta_tof_s", quantised).impossible_times == {}
    for offset in (-3e-6, 5e-6):
        dataset = replace(RIGHT, tof_s=RIGHT.tof_s + offset, delta_tof_s=delta + offset)
        assert dataset.impossible_times == {}
    # An emitter and a receiver at one place.
    position = np.concatenate((on_ring(16), on_ring(16)))
    together = scan(position, range(16), range(16, 32))
    assert together.impossible_times == {}
    for name, factor in (("tof_s", 1e3), ("tof_s", 1e6), ("delta_tof_s", 1e3), ("delta_tof_s", 1e6)):
        other_unit = with_times(name, factor * getattr(RIGHT, name))
        assert other_unit.impossible_times == {}
        with pytest.raises(InvalidInput, match=f"these times look like {'ms' if factor == 1e3 else 'µs'}"):
            check_plausible(other_unit)


def test_masked_arrays_are_missing_values():
    dataset = replace(
        RIGHT,
        delta_tof_s=None,
        tof_s=np.ma.masked_array(RIGHT.tof_s, FAILED),
        sigma_s=np.ma.masked_array(np.full((32, 32), 1e-8), FAILED),
        log_ratio_np=np.ma.masked_array(np.zeros((32, 32)), FAILED),
        valid=np.ma.masked_array(np.ones((32, 32), dtype=bool), FAILED),
    )
    for array in (dataset.tof_s, dataset.sigma_s, dataset.log_ratio_np):
        assert type(array) is np.ndarray
        np.testing.assert_array_equal(np.isnan(array), FAILED)
    np.testing.assert_array_equal(dataset.valid, ~FAILED)
    assert dataset.impossible_times == {"masked": FAILED.sum()}
    with pytest.raises(InvalidInput, match="geometry/element_position_m: found a masked array"):
        replace(
            RIGHT,
            element_position_m=np.ma.masked_less(RIGHT.element_position_m, -0.07),
        )
    traces = np.ma.masked_array(np.ones((2, 2, 4), dtype=np.int16), np.arange(16).reshape(2, 2, 4) == 5)
    held = Waveform(traces).object
    assert held.dtype == np.float32
    np.testing.assert_array_equal(np.isnan(held), traces.mask)


SPEED = np.ma.masked_array(np.full((9, 9), 1500.0), np.eye(9, dtype=bool))
PLAIN = SPEED.filled(1500.0)


@pytest.mark.parametrize(
    "call",
    [
        lambda: eikonal.solve(SPEED, 1e-3, np.array([1e-3, 4e-3])),
        lambda: eikonal.solve_many(SPEED[None], 1e-3, np.array([[1e-3, 4e-3]])),
        lambda: trace(SPEED, 1e-3, np.array([[1e-3, 1e-3]]), np.array([4e-3, 1e-3])),
        lambda: prefilter(SPEED, 3),
        lambda: Medium.from_speed(SPEED, 1e-3, 1e-8),
        lambda: rmse(PLAIN, SPEED, PLAIN > 0.0),
    ],
)
def test_masked_speeds_and_images_are_refused(call):
    with pytest.raises(InvalidInput, match=r"a masked array, 9 of 81 values masked, the first at"):
        call()


def test_sigma_of_a_missing_time_is_of_no_interest():
    dataset = replace(
        RIGHT, tof_s=np.where(FAILED, 0.0, RIGHT.tof_s), delta_tof_s=None, sigma_s=np.where(FAILED, 0.0, 1e-8)
    )
    np.testing.assert_array_equal(np.isnan(dataset.sigma_s), FAILED)


@pytest.mark.parametrize("name", ["tof_s", "delta_tof_s"])
def test_a_scan_that_lost_more_times_than_it_has_is_refused(name):
    for lost in (496, 497):
        times = getattr(RIGHT, name).copy()
        times[tuple(np.argwhere(OTHER)[:lost].T)] = np.inf
        if lost == 496:
            check_plausible(with_times(name, times))
    with pytest.raises(InvalidInput, match=rf"^traveltime/{name}: found .*497 infinite\) and only 495"):
        check_plausible(with_times(name, times))


@pytest.mark.parametrize("part", [0.2, 0.45, 0.9])
def test_a_scan_without_most_of_its_times_is_not_usable_unless_the_user_insists(part):
    failed = OTHER & (np.random.default_rng(2).random((32, 32)) < part)
    dataset = with_times("tof_s", np.where(failed, 0.0, RIGHT.tof_s))
    if part > 0.6:
        with pytest.raises(InvalidInput, match="traveltime/tof_s"):
            check_plausible(dataset)
        return
    report = examine(dataset).report
    assert report.findings[0].check == "impossible times"
    assert report.findings[0].found == f"{failed.sum()} zero or negative"
    if part < 0.33:
        assert report.verdict == "usable"
        return
    assert report.verdict == "refused"
    assert report.refusal.check == "pairs left out"
    assert "max_left_out" in report.refusal.accepted
    insisted = examine(dataset, max_left_out=1.0)
    assert insisted.report.verdict == "usable"
    assert insisted.picked is not None
