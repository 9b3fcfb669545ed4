"""Units that the numbers of a scan suggest: the one by which it was spoilt, and none for a usual scan."""

from dataclasses import replace

import numpy as np
import pytest

from bentray_kernels.acquisition import Dataset
from bentray_workers.files.dataset import Correction
from bentray_workers.files.dataset.correct import corrected
from bentray_workers.files.dataset.units import POSITION_UNITS, TIME_UNITS, propose


def breast(radius_m=0.11):
    """A ring with differences of at most 1.3 µs, as of a breast."""
    angle = 2.0 * np.pi * np.arange(32) / 32
    position = radius_m * np.column_stack((np.cos(angle), np.sin(angle)))
    distance = np.linalg.norm(position[:, None] - position[None], axis=-1)
    return Dataset(
        element_position_m=position,
        tx=np.arange(32),
        rx=np.arange(32),
        water_speed_mps=1500.0,
        delta_tof_s=-0.009 * distance / 1500.0,
        center_frequency_hz=5e5,
    )


@pytest.mark.parametrize("radius_m", [0.025, 0.11, 0.3])
def test_a_usual_scan_suggests_nothing(radius_m):
    assert propose(breast(radius_m), 4.2e5) == []
    assert propose(replace(breast(), delta_tof_s=np.zeros((32, 32))), None) == []


@pytest.mark.parametrize("factor", [0.1, 10.0])
def test_lengths_in_another_unit(factor):
    usual = breast()
    wrong = replace(usual, element_position_m=factor * usual.element_position_m)
    (proposal,) = propose(wrong, None)
    assert proposal.what == "positions"
    assert POSITION_UNITS[proposal.unit] / POSITION_UNITS[proposal.read_as] == pytest.approx(1.0 / factor)
    assert "220 mm are usual" in proposal.reason
    made = corrected(
        wrong, Correction(positions_in=proposal.unit, positions_read_as=proposal.read_as), "scan"
    )
    np.testing.assert_allclose(made.element_position_m, usual.element_position_m)


@pytest.mark.parametrize("contrast", [0.3, 1.0, 4.0])
@pytest.mark.parametrize("factor", [1e-3, 1e-6, 1e-9])
def test_times_in_another_unit(factor, contrast):
    usual = replace(breast(), delta_tof_s=contrast * breast().delta_tof_s)
    assert propose(usual, None) == []
    (proposal,) = propose(replace(usual, delta_tof_s=factor * usual.delta_tof_s), None)
    assert proposal.what == "times"
    assert TIME_UNITS[proposal.unit] / TIME_UNITS[proposal.read_as] == pytest.approx(1.0 / factor)


@pytest.mark.parametrize("factor", [1e3, 0.2])
def test_a_frequency_far_from_that_of_the_traces(factor):
    (proposal,) = propose(replace(breast(), center_frequency_hz=factor * 5e5), 4.9e5)
    assert (proposal.what, proposal.frequency_hz) == ("frequency", 4.9e5)
    assert "490 kHz" in proposal.reason
