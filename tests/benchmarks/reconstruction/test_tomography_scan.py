"""The scan of the slice that nothing was tuned on, with times of straight rays in place of a peer's."""

import numpy as np
import pytest
from benchmarks.reconstruction._tomography_scan import (
    REFINEMENT,
    SIDE_M,
    SPEEDS_MPS,
    breast,
    fine_spacing,
    positions,
    scan,
)


def in_water(speed: np.ndarray, spacing: float, node: tuple[int, ...]) -> np.ndarray:
    """Solve in the speed of the corner, everywhere."""
    i, j = np.ogrid[: speed.shape[0], : speed.shape[1]]
    return np.hypot(i - node[0], j - node[1]) * spacing / speed[0, 0]


def test_elements_are_nodes_of_the_fine_grid_near_the_circle() -> None:
    position, spacing = positions(64, 64), fine_spacing(64)
    cells = position / spacing
    assert cells == pytest.approx(np.rint(cells))
    assert np.ptp(np.linalg.norm(position, axis=1)) < 1.5 * spacing
    assert len(np.unique(position, axis=0)) == 64


def test_times_are_read_at_the_elements_and_less_those_of_water() -> None:
    done: list[tuple[int, int]] = []
    dataset = scan(1480.0, 32, 12, in_water, lambda *step: done.append(step))
    assert dataset.delta_tof_s is not None
    off = ~np.eye(12, dtype=bool)
    assert np.abs(dataset.delta_tof_s[off]).max() < 1e-17
    assert np.isnan(dataset.delta_tof_s[~off]).all()
    assert done[-1] == (12, 12)


def test_the_truth_is_the_slice_in_the_speeds_of_its_tissue() -> None:
    dataset = scan(1475.0, 32, 4, in_water, lambda *step: None)
    assert dataset.truth is not None
    truth = dataset.truth.sound_speed_mps
    assert truth.shape == dataset.roi.shape == (32, 32)  # type: ignore[union-attr]
    assert truth[0, 0] == 1475.0
    assert min(SPEEDS_MPS.values()) == truth.min()
    assert truth.max() <= max(SPEEDS_MPS.values())
    assert breast(1475.0).speed_range() == (min(SPEEDS_MPS.values()), max(SPEEDS_MPS.values()))


def test_the_solver_gets_a_grid_as_fine_as_promised() -> None:
    seen: list[tuple[tuple[int, ...], float]] = []

    def spy(speed: np.ndarray, spacing: float, node: tuple[int, ...]) -> np.ndarray:
        seen.append((speed.shape, spacing))
        return in_water(speed, spacing, node)

    scan(1500.0, 32, 4, spy, lambda *step: None)
    side = REFINEMENT * 31 + 1
    assert [shape for shape, _ in seen] == [(side, side)] * 4
    assert [spacing for _, spacing in seen] == pytest.approx([SIDE_M / (side - 1)] * 4)
