"""Scans in other units than SI are refused by the unit that they are in; real and rough ones are taken."""

from dataclasses import replace

import numpy as np
import pytest

from bentray_kernels.acquisition.plausibility import check_plausible
from bentray_kernels.errors import InvalidInput

from ..straight_scans import ring_scan

POSITION, ABSOLUTE, DELTA = "geometry/element_position_m", "traveltime/tof_s", "traveltime/delta_tof_s"


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
