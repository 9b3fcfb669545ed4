"""Wrong orders of elements are found and named; arrays, objects, noise and other faults raise no alarm."""

from dataclasses import replace

import numpy as np
import pytest

from bentray_kernels.acquisition import Dataset
from bentray_kernels.acquisition.arrangement import find_mismatch, rearranged
from bentray_kernels.acquisition.plausibility import WrongArrangement, check_plausible
from bentray_kernels.acquisition.simulation.array_shapes import bowl, facing_lines
from bentray_kernels.errors import InvalidInput
from bentray_workers.files.dataset import read_dataset

from ...effort import effort
from ..straight_scans import DATA, chords_m, radar, trunk

WATER = 1480.0
RADIUS = 0.08
# Centre (x, y) and radius, m, and speed, m/s.
OBJECTS = {
    "small": (0.02, 0.01, 0.02, 1520.0),
    "large": (0.0, 0.0, 0.07, 1540.0),
    "beside": (0.05, 0.0, 0.02, 1450.0),
    "bone": (0.01, 0.02, 0.02, 3500.0),
}


def on_ring(count, arc=2.0 * np.pi, jitter=0.0):
    angle = arc * (np.arange(count) + jitter * np.random.default_rng(5).normal(size=count)) / count
    return RADIUS * np.stack((np.cos(angle), np.sin(angle)), axis=1)


def scan(position, tx=None, rx=None, of="small"):
    """Times along straight rays through a disk or a cylinder, absolute and as differences."""
    every = np.arange(len(position))
    tx, rx = (every if side is None else np.asarray(side) for side in (tx, rx))
    x, y, radius, speed = OBJECTS[of]
    bare = Dataset(position, tx, rx, WATER, delta_tof_s=np.zeros((len(tx), len(rx))))
    delta = chords_m(bare, radius, (x, y)) * (1.0 / speed - 1.0 / WATER)
    return replace(bare, tof_s=bare.distance_m() / WATER + delta, delta_tof_s=delta)


def kind_of(dataset, kind):
    return replace(dataset, **{"delta_tof_s" if kind == "absolute" else "tof_s": None})


def changed(dataset, change):
    """The scan with its times changed alike in both kinds."""
    return replace(dataset, tof_s=change(dataset.tof_s), delta_tof_s=change(dataset.delta_tof_s))


def grid_order(position):
    """The order of a mask on a grid whose first axis is the fast one."""
    return np.lexsort((position[:, 0].round(6), position[:, 1].round(6)))


GRID = grid_order(on_ring(32))
# What happened to the times of a ring, and the name of the fault.
FAULTS = {
    "receivers-shifted-by-1": lambda t: np.roll(t, 1, axis=1),
    "receivers-shifted-by-minus-3": lambda t: np.roll(t, -3, axis=1),
    "receivers-reversed": lambda t: t[:, ::-1],
    "receivers-reversed-shifted-by-1": lambda t: np.roll(t[:, ::-1], 1, axis=1),
    "receivers-odd-even": lambda t: t[:, np.r_[0:32:2, 1:32:2]],
    "receivers-grid-yx": lambda t: t[:, GRID],
    "elements-grid-yx": lambda t: t[np.ix_(GRID, GRID)],
}


@pytest.mark.parametrize("kind", ["absolute", "differences"])
@pytest.mark.parametrize("name", FAULTS)
def test_a_wrong_order_is_refused_by_its_name_and_set_right_by_it(name, kind):
    right = kind_of(scan(on_ring(32)), kind)
    wrong = kind_of(changed(scan(on_ring(32)), FAULTS[name]), kind)
    with pytest.raises(WrongArrangement) as refusal:
        check_plausible(wrong)
    field = "traveltime/tof_s" if kind == "absolute" else "traveltime/delta_tof_s"
    assert refusal.value.field == field
    proposal = refusal.value.proposal
    if proposal is None:
        # A mirror image of a small object cannot be told from another order by differences alone.
        assert kind == "differences"
        assert name == "elements-grid-yx"
        return
    assert proposal.name == name
    assert proposal.words in refusal.value.accepted
    again = rearranged(wrong, proposal.name)
    check_plausible(again)
    # Each time belongs to a pair of elements as far apart as before.
    np.testing.assert_allclose(again.distance_m(), FAULTS[name](right.distance_m()), atol=1e-12)


def in_degrees(position):
    angle = np.degrees(np.arctan2(position[:, 1], position[:, 0]) % (2.0 * np.pi))
    return RADIUS * np.stack((np.cos(angle), np.sin(angle)), axis=1)


@pytest.mark.parametrize(
    ("name", "spoil"),
    [
        ("positions-in-degrees", in_degrees),
        ("positions-transposed", lambda p: np.ascontiguousarray(p.T.reshape(p.shape))),
    ],
)
@pytest.mark.parametrize("count", [8, 32, 100])
def test_wrong_positions_are_named_and_set_right(name, spoil, count):
    right = kind_of(scan(on_ring(count)), "absolute")
    mismatch = find_mismatch(replace(right, element_position_m=spoil(right.element_position_m)))
    assert mismatch is not None
    assert mismatch.proposal is not None
    assert mismatch.proposal.name == name
    moved = mismatch.proposal.position_m
    np.testing.assert_allclose(
        np.linalg.norm(moved[:, None] - moved, axis=-1), right.distance_m(), atol=1e-9, rtol=0.0
    )


def test_a_shift_of_one_is_found_on_many_elements_with_noise():
    whole = scan(on_ring(256))
    noise = 3e-8 * np.random.default_rng(0).normal(size=(256, 256))
    wrong = changed(whole, lambda t: np.roll(t + noise, 1, axis=1))
    assert find_mismatch(kind_of(wrong, "absolute")).proposal.name == "receivers-shifted-by-1"


@pytest.mark.parametrize("seed", range(3))
def test_an_order_that_is_none_of_the_family_is_refused_with_its_numbers(seed):
    order = np.random.default_rng(seed).permutation(32)
    mismatch = find_mismatch(
        changed(kind_of(scan(on_ring(32)), "absolute"), lambda t: None if t is None else t[:, order])
    )
    assert mismatch is not None
    assert mismatch.proposal is None
    assert "% of that of shuffled times" in mismatch.found


@pytest.mark.parametrize(
    "change", [lambda t: t[::-1, ::-1], lambda t: np.roll(t, (2, 2), (0, 1)), lambda t: t.T]
)
def test_what_only_turns_or_mirrors_the_image_is_not_proposed(change):
    for kind in ("absolute", "differences"):
        assert find_mismatch(kind_of(changed(scan(on_ring(32)), change), kind)) is None


def test_an_unknown_name_is_refused():
    with pytest.raises(InvalidInput, match="arrangement: found 'receivers-upside-down'"):
        rearranged(scan(on_ring(8)), "receivers-upside-down")


LEVELS = np.linspace(-0.05, 0.05, 6)
LINES = facing_lines(24, 0.16, 0.16).position_m
PLANES = np.array([(x, y, z) for z in (-0.06, 0.06) for y in LEVELS for x in LEVELS])
# Positions, emitters and receivers.
ARRAYS = {
    "ring of 8": (on_ring(8), None, None),
    "ring of 16": (on_ring(16), None, None),
    "ring of 64": (on_ring(64), None, None),
    "every fourth emits": (on_ring(64), range(0, 64, 4), None),
    "arc": (on_ring(40, arc=1.2 * np.pi), None, None),
    "uneven ring": (on_ring(40, jitter=0.3), None, None),
    "facing lines": (LINES, range(24), range(24, 48)),
    "lines, all elements": (LINES, None, None),
    "one element inside": (np.concatenate((on_ring(48), [[0.001, 0.002]])), [48], range(48)),
    "bowl": (bowl(60, 0.1).position_m, range(0, 60, 2), None),
    "planes": (PLANES, range(36), range(36, 72)),
}


def spoilt(dataset_name, of):
    """Scans in the right order, with all that may be wrong with them otherwise."""
    base = scan(*ARRAYS[dataset_name], of=of)
    random = np.random.default_rng(1)
    shape, rms = base.tof_s.shape, np.sqrt((base.delta_tof_s**2).mean())
    some = random.random(shape) < 0.1
    anywhere = random.uniform(0.0, 2.0 * base.tof_s.max(), shape)
    upper = np.triu(np.ones(shape, dtype=bool), 1)
    noise = {f"noise {part}": part * rms * random.normal(size=shape) for part in (0.03, 0.1, 1.0)}
    results = {
        "right": base,
        "outliers": replace(
            base,
            tof_s=np.where(some, anywhere, base.tof_s),
            delta_tof_s=np.where(some, anywhere - base.tof_s, base.delta_tof_s),
        ),
        "dead": changed(base, lambda t: np.where(np.arange(len(t))[:, None] % 5 == 0, np.nan, t)),
        "half": changed(base, lambda t: np.where(upper, t, np.nan)),
        "water alone": replace(base, tof_s=base.distance_m() / WATER, delta_tof_s=np.zeros(shape)),
    }
    results |= {name: changed(base, lambda t, part=part: t + part) for name, part in noise.items()}
    results |= {f"offset {s}": changed(base, lambda t, s=s: t + s) for s in (-3e-6, 2e-5)}
    return results


@pytest.mark.parametrize("number", range(len(ARRAYS)), ids=list(ARRAYS))
def test_no_alarm_for_scans_in_the_right_order(number):
    names = [list(OBJECTS)[(number + k) % len(OBJECTS)] for k in range(effort(1, len(OBJECTS)))]
    alarms = {
        (name, kind, of): mismatch.found
        for of in names
        for name, dataset in spoilt(list(ARRAYS)[number], of).items()
        for kind in ("absolute", "differences")
        if (mismatch := find_mismatch(kind_of(dataset, kind))) is not None
    }
    assert alarms == {}


@pytest.mark.real
@pytest.mark.parametrize(
    "make", [radar, trunk, lambda: read_dataset(DATA / "openust_measured.h5", traces=False)]
)
def test_no_alarm_for_measured_scans_and_one_for_these_reversed(make):
    if not DATA.exists():
        pytest.skip(f"no measured scans in {DATA}")
    dataset = make()
    check_plausible(dataset)
    absolute = replace(
        dataset,
        tof_s=dataset.differential_tof() + dataset.distance_m() / dataset.water_speed_mps,
        delta_tof_s=None,
    )
    assert find_mismatch(absolute) is None
    assert find_mismatch(replace(absolute, tof_s=absolute.tof_s[:, ::-1])) is not None
