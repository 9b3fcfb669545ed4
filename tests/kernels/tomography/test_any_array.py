"""Arrays of any shape: images better than water inside their hull, and what limits them in words."""

import re
from dataclasses import replace
from functools import cache
from typing import NamedTuple

import numpy as np
import pytest

from bentray_kernels.acquisition import Dataset, Truth
from bentray_kernels.acquisition.array_hull import depth_inside
from bentray_kernels.acquisition.quality import examine
from bentray_kernels.acquisition.quality.examination import OF_TIMES
from bentray_kernels.acquisition.simulation.array_shapes import arc, bowl, facing_lines
from bentray_kernels.acquisition.simulation.fine_medium import FineMedium
from bentray_kernels.errors import InvalidInput
from bentray_kernels.tomography import Problem, Settings, reconstruct, rmse
from bentray_kernels.tomography.decomposition import decomposition_of
from bentray_kernels.tomography.problem import RIM_NODES
from bentray_kernels.tomography.requirements import check_scan

WATER, RADIUS, HALF = 1480.0, 0.045, 0.05
PLAN = Settings(method="gauss-newton", nodes=40, iterations=4)
IN_SPACE = Settings(method="gauss-newton", nodes=24, iterations=3)


def speed(*x):
    """A ball faster than water around a slow one."""
    ball, inner = (
        (sum((a - c) ** 2 for a, c in zip(x, at, strict=False)))
        for at in ((0.0, 0.002, -0.012), (0.006, 0.0, -0.01))
    )
    return WATER + 50.0 / (1.0 + (ball / 0.018**2) ** 6) - 70.0 / (1.0 + (inner / 0.007**2) ** 4)


class Case(NamedTuple):
    """Elements of an array, and those that emit and receive; None: all."""

    elements: object
    tx: np.ndarray | None = None
    rx: np.ndarray | None = None


def cases():
    ring = arc(48, RADIUS)
    missing = (ring.position_m >= -1e-9).all(axis=1)
    inside = np.array([[0.03, -0.018]])
    lines = facing_lines(24, 0.08, 0.06)
    return {
        "ring": Case(ring),
        "lines": Case(lines, np.arange(24), np.arange(24, 48)),
        "arc": Case(arc(40, RADIUS, 200.0)),
        "quarter": Case(type(ring)(ring.position_m[~missing], ring.normal[~missing])),
        "inside": Case(
            type(ring)(*(np.vstack((a, b)) for a, b in zip(ring, (inside, -inside), strict=True)))
        ),
        "apart": Case(ring, np.arange(0, 48, 2), np.arange(1, 48, 2)),
        "bowl": Case(bowl(56, RADIUS)),
    }


@cache
def scan(name):
    """Times by another solver on a finer grid."""
    elements, tx, rx = cases()[name]
    position = elements.position_m
    everyone = np.arange(len(position))
    tx, rx = (everyone if index is None else index for index in (tx, rx))
    flat = position.shape[1] == 2
    spacing, low = (0.0006, [-HALF] * 2) if flat else (0.0028, [-HALF, -HALF, -HALF])
    lines = [
        o + spacing * np.arange(int((2 if k < 2 else 1) * HALF / spacing) + 2) for k, o in enumerate(low)
    ]
    medium = FineMedium(speed(*np.meshgrid(*lines, indexing="ij")), spacing, WATER)
    delta, _ = medium.arrivals(position - low, tx)
    return Dataset(
        position, tx, rx, WATER, delta_tof_s=delta[:, rx], element_normal=elements.normal, array_type="free"
    )


def truth(problem):
    lines = [
        o + problem.spacing * np.arange(n) for o, n in zip(problem.origin, problem.region.shape, strict=True)
    ]
    grid = np.meshgrid(*lines, indexing="ij")
    return speed(*grid), np.stack(grid, axis=-1)


@cache
def image(name):
    return reconstruct(scan(name), IN_SPACE if name == "bowl" else PLAN)


# Largest error inside the hull over that of water alone, and words about the geometry.
EXPECTED = [
    ("ring", 0.15, ""),
    ("lines", 0.45, r"paths run in 5\d % of the directions .* 60° to 120° from the x axis, are blurred"),
    ("arc", 0.55, r"elements cover 205° of 360°, .* edges parallel to the missing directions"),
    ("quarter", 0.45, r"elements cover 26[23]° of 360°"),
    ("inside", 0.15, ""),
    ("apart", 0.2, ""),
    ("bowl", 0.35, r"3-D .decomposition: volume., since 56 elements at 56 heights"),
]


@pytest.mark.parametrize(("name", "most", "words"), EXPECTED, ids=[name for name, *_ in EXPECTED])
def test_the_image_inside_the_hull_is_better_than_water(name, most, words):
    result, problem = image(name), Problem.from_dataset(scan(name), image(name).settings)
    true, place = truth(problem)
    depth = depth_inside(scan(name).element_position_m, place.reshape(-1, place.shape[-1]))
    inside = depth.reshape(true.shape) >= RIM_NODES * problem.spacing - 1e-9
    if name != "bowl":
        # The rim of an element inside is the rest.
        assert (problem.region != inside).sum() <= (13 if name == "inside" else 0)
    water = np.full_like(true, WATER)
    assert rmse(result.speed, true, problem.region) < most * rmse(water, true, problem.region)
    assert np.array_equal(result.speed[~problem.region], water[~problem.region])
    found = result.provenance.get("geometry", "")
    assert re.search(words, found) if words else not found
    assert result.settings.decomposition == ("volume" if name == "bowl" else "slices")


@pytest.mark.parametrize("name", list(cases()))
def test_the_quality_report_names_a_limited_angle_and_what_does_not_apply(name):
    report = examine(scan(name)).report
    assert ("angular coverage" in {f.check for f in report.findings}) == (name in ("lines", "arc", "quarter"))
    assert report.usable > 0.98 * report.pairs
    apart = name in ("lines", "apart")
    assert ("no elements both emit and receive" in report.not_checked.values()) == apart
    assert set(report.not_checked) | set(report.checked) == {
        *OF_TIMES,
        "impossible times",
        "angular coverage",
        "pairs left out",
    }
    assert not set(report.not_checked) & set(report.checked)


def test_pairs_outside_the_opening_angle_are_left_out():
    dataset, settings = scan("ring"), PLAN.changed(opening_angle_deg=90.0)
    # Seen from an element of a circle, the middle of the others is at half the angle of their arc.
    apart = np.abs(np.subtract.outer(np.arange(48), np.arange(48)))
    wide = np.minimum(apart, 48 - apart) >= 12
    assert np.array_equal(np.isfinite(Problem.from_dataset(dataset, settings).delta_tof), wide)
    result, problem = reconstruct(dataset, settings), Problem.from_dataset(dataset, settings)
    words = "1056 of 2256 pairs (47 %) are outside the opening angle of 90°"
    assert words in result.provenance["geometry"]
    true, _ = truth(problem)
    water = np.full_like(true, WATER)
    assert rmse(result.speed, true, problem.region) < 0.2 * rmse(water, true, problem.region)


@pytest.mark.parametrize(
    ("normal", "angle", "field", "words"),
    [
        (None, 90.0, "opening_angle_deg", "directions in the file .geometry/element_normal"),
        (np.zeros((48, 2)), 90.0, "geometry/element_normal", "length > 0"),
        (arc(48, RADIUS).position_m, 90.0, "opening_angle_deg", "directions that point towards the object"),
    ],
)
def test_directions_that_are_of_no_use_are_refused(normal, angle, field, words):
    dataset = replace(scan("ring"), element_normal=normal)
    with pytest.raises(InvalidInput, match=words) as refusal:
        Problem.from_dataset(dataset, PLAN.changed(opening_angle_deg=angle))
    assert refusal.value.field == field
    if normal is None:
        with pytest.raises(InvalidInput, match=words):
            check_scan(dataset, PLAN.changed(opening_angle_deg=angle), 0)


def test_a_region_that_paths_leave_is_a_warning():
    problem = Problem.from_dataset(scan("ring"), PLAN)
    grid = Truth(np.full(problem.region.shape, WATER), (problem.spacing,) * 2, problem.origin, axes="x,y")
    x, y = np.meshgrid(*2 * [np.arange(40) - 19.5])
    dataset = replace(scan("ring"), truth=grid, roi=np.hypot(x, y) < 7.0)
    found = reconstruct(dataset, PLAN.changed(roi=True, iterations=1)).provenance["geometry"]
    assert re.match(r"Warning: \d+ of 1128 pairs \(\d+ %\) leave the region of interest", found)


@pytest.mark.parametrize("settings", [PLAN, PLAN.changed(method="auto")])
def test_elements_on_one_line_are_refused(settings):
    line = np.column_stack((np.zeros(24), np.linspace(-0.04, 0.04, 24)))
    everyone = np.arange(24)
    dataset = Dataset(line, everyone, everyone, WATER, delta_tof_s=np.zeros((24, 24)), array_type="free")
    for refused in (lambda: check_scan(dataset, settings, 0), lambda: reconstruct(dataset, settings)):
        with pytest.raises(InvalidInput, match=r"all elements on one line.*several sides of the object"):
            refused()


def test_the_decomposition_follows_the_heights_of_the_elements():
    ring, settings = arc(8, RADIUS).position_m, Settings()
    rings = np.concatenate([np.column_stack((ring, np.full(8, z))) for z in (0.0, 0.01)])
    for position, expected in (
        (ring, "slices"),
        (rings, "slices"),
        (rings[1:], "volume"),
        (rings[:8], "slices"),
    ):
        assert decomposition_of(position, settings) == expected
    lines = facing_lines(6, 0.08, 0.08).position_m
    planes = np.concatenate([np.column_stack((lines, np.full(12, z))) for z in (0.0, 0.01)])
    assert decomposition_of(planes, settings) == "volume"
    assert decomposition_of(rings[1:], Settings(decomposition="slices")) == "slices"
