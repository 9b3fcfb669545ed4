"""Settings that earlier versions stored are read as those of today."""

import json

import pytest

from bentray_kernels.tomography import Settings
from bentray_kernels.tomography.stored_settings import from_stored


def test_settings_of_today_come_back():
    settings = Settings(nodes=32, speed_bounds_mps=(1400.0, 1600.0))
    assert from_stored(json.loads(json.dumps(settings.to_dict()))) == settings


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ({"huber_s": 1e-7, "wave_misfit": "least-squares", "wave_variation": 0.3}, {}),
        ({"rays": "adjoint"}, {"rays": "curved"}),
        ({"amplitudes": "centroid"}, {"amplitudes": "spectrum"}),
    ],
)
def test_what_is_gone_is_left_out_or_replaced(old, new):
    assert from_stored(old) == Settings(**new)


def test_a_name_that_no_version_had_is_refused():
    with pytest.raises(TypeError):
        from_stored({"swept": 1})
