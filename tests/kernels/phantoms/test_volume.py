"""Volume phantoms: exact at points, their slices two-dimensional phantoms."""

import numpy as np
import pytest

from bentray_kernels.errors import InvalidInput
from bentray_kernels.phantoms import Ellipsoid, Part, VolumePhantom

BALL = Part(Ellipsoid((0.0, 0.0, 0.0), (0.051, 0.051, 0.051)), 1400.0, 20.0, "ball")
CORE = Part(Ellipsoid((0.0, 0.0, 0.0), (0.02, 0.02, 0.02)), 1550.0, 60.0, "core")
PHANTOM = VolumePhantom(1500.0, (BALL, CORE), 0.5)


def test_points_have_the_topmost_part():
    x = np.array([0.0, 0.03, 0.06])
    assert PHANTOM.speed_at(x, 0.0, 0.0).tolist() == [1550.0, 1400.0, 1500.0]
    assert PHANTOM.at(0.03).speed_at(x, 0.0).tolist() == [1400.0, 1400.0, 1500.0]
    assert PHANTOM.speed_range() == PHANTOM.at(0.0).speed_range() == (1400.0, 1550.0)


def test_grids_and_slices_have_their_axes_in_order():
    z = np.array([-0.048, 0.0, 0.048])
    volume = PHANTOM.attenuation(21, 0.2, z)
    assert volume.shape == PHANTOM.inside(21, 0.2, z).shape == (21, 21, 3)
    assert volume[10, 10, 1] < 60.0
    assert volume[0, 0].tolist() == [0.5, 0.5, 0.5]
    assert PHANTOM.at(0.0).attenuation(21, 0.2)[10, 10] == 60.0
    assert PHANTOM.inside(21, 0.2, z).sum(axis=(0, 1)).tolist() == [9, 89, 9]


@pytest.mark.parametrize(
    ("field", "arguments"), [("coupling_mps", (0.0, ())), ("coupling_np_m", (1.0, (), -1.0))]
)
def test_bad_coupling_is_rejected(field, arguments):
    with pytest.raises(InvalidInput, match=field):
        VolumePhantom(*arguments)
