"""Stored settings come back, those that no user sets any more included."""

import json

import pytest

from bentray_kernels.errors import InvalidInput
from bentray_kernels.tomography import Settings
from bentray_kernels.tomography.numerics import recorded
from bentray_kernels.tomography.stored_settings import FIXED, WITHDRAWN, from_stored


def test_settings_of_today_come_back():
    settings = Settings.from_values(
        method="sart", nodes=32, speed_bounds_mps=(1400.0, 1600.0), picker="threshold", attenuation=False
    )
    assert from_stored(json.loads(json.dumps(settings.to_dict()))) == settings
    assert from_stored(
        Settings(method="sart").to_dict(), {"subset": 4, "stop_rms_s": None}
    ) == Settings.from_values(method="sart", subset=4)


def test_those_of_earlier_versions_are_computed_to_the_same_bits():
    before = {"seed": 5, "gauss_newton": {"penalty": "laplacian"}, "attenuation": {"focusing": True}}
    assert from_stored(before) == Settings.from_values(seed=5, penalty="laplacian", focusing=True)
    before = {"eikonal": "fmm", "sart": {"relaxation": 0.2, "speed_range_mps": [1400.0, 1600.0]}}
    fixed = {"eikonal": "fmm", "relaxation": 0.2, "speed_range_mps": (1400.0, 1600.0)}
    assert from_stored(before) == Settings.from_values(**fixed)
    stored = json.loads(recorded(Settings.from_values(**fixed).numerics)["numerics"])
    assert from_stored(Settings(eikonal="fmm").to_dict(), stored) == Settings.from_values(**fixed)
    assert from_stored({"reflection": {"enabled": True}}, dict(FIXED)) == Settings.from_values(
        reflection=True
    )


@pytest.mark.parametrize("name", FIXED)
def test_a_value_that_nothing_computes_any_more_is_rejected(name):
    with pytest.raises(InvalidInput, match=f"{name}: found 7; accepted: {FIXED[name]}: ") as refused:
        from_stored({"method": "sart"}, {name: 7})
    assert WITHDRAWN.get(name, "it was removed") in refused.value.accepted


def test_a_name_that_no_version_had_is_rejected():
    with pytest.raises(TypeError):
        from_stored({"swept": 1})
    with pytest.raises(InvalidInput, match="relaxation: found 7"):
        from_stored({"relaxation": 7})
