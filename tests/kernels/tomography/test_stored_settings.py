"""Stored settings, those of earlier versions too, are read as those of today."""

import json

import pytest

from bentray_kernels.errors import InvalidInput
from bentray_kernels.tomography.settings import NUMERICAL, PLACES, Settings
from bentray_kernels.tomography.stored_settings import REMOVED, RENAMED, from_stored

# What the last version with a flat record stored by default.
FLAT = {
    "method": "sart",
    "rays": "curved",
    "eikonal": "deviation",
    "decomposition": "slices",
    "axial_room_nodes": None,
    "nodes": 128,
    "side_m": None,
    "sweeps": 5,
    "straight_sweeps": 0,
    "coarser_grids": 0,
    "stop_rms_s": 0.0,
    "speed_bounds_mps": [1300.0, 1800.0],
    "speed_update": "fixed",
    "speed_range_mps": None,
    "front_smoothing_nodes": 0.0,
    "ray_width_m": 0.0,
    "relaxation": 0.1,
    "relaxation_decay": 1.0,
    "subset": 1,
    "smoothing_nodes": 1.0,
    "seed": 0,
    "penalty": "total-variation",
    "penalty_strength": 0.3,
    "edge_mps": 0.0,
    "huber_s": 0.0,
    "huber_spreads": 3.0,
    "roi": False,
    "reciprocity": True,
    "picker": "aic",
    "examine": True,
    "guided_rounds": 0,
    "attenuation": True,
    "amplitudes": "recorded",
    "focusing": False,
    "resolution_check": False,
    "wave_bands": 4,
    "wave_misfit": "correlation",
    "wave_emitters": 0,
    "wave_variation": 0.0,
    "wave_minutes": 0.0,
}


def test_settings_of_today_come_back():
    settings = Settings.of(
        method="sart", nodes=32, speed_bounds_mps=(1400.0, 1600.0), relaxation=0.3, attenuation=False
    )
    assert from_stored(json.loads(json.dumps(settings.to_dict()))) == settings
    assert from_stored(Settings(method="sart").to_dict(), {"subset": 4, "stop_rms_s": None}) == Settings.of(
        method="sart", subset=4
    )


def test_the_defaults_of_the_flat_record_are_those_of_its_time():
    assert from_stored(FLAT) == from_stored({}) == Settings(method="sart", nodes=128, decomposition="slices")


def test_every_name_of_the_flat_record_has_its_place():
    for name in FLAT:
        assert name in REMOVED or RENAMED.get(name, name) in (*PLACES, *NUMERICAL)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ({"huber_s": 1e-7, "wave_misfit": "least-squares", "wave_variation": 0.3}, {}),
        ({"rays": "adjoint"}, {"rays": "curved"}),
        ({"amplitudes": "centroid"}, {"amplitudes": "spectrum"}),
        ({"sweeps": 2, "relaxation": 0.2, "subset": 3}, {"iterations": 2, "relaxation": 0.2, "subset": 3}),
        ({"attenuation": False}, {"attenuation": False}),
        ({"speed_update": "fixed", "speed_range_mps": [1400, 1600]}, {}),
        (
            {"speed_update": "data-driven", "speed_range_mps": [1400, 1600]},
            {"speed_range_mps": (1400, 1600)},
        ),
        # All bands or none were refined, whatever the budget.
        (
            {"method": "auto", "wave_minutes": 9.0, "wave_bands": 4, "wave_emitters": 0},
            {"method": "auto", "minutes": 9.0, "bands": 4},
        ),
        ({"method": "waveform", "wave_minutes": 9.0, "wave_bands": 2}, {"method": "waveform", "bands": 2}),
        ({"stop_rms_s": 1e-7}, {"stop_rms_s": 1e-7}),
        ({"stop_rms_s": 0.0}, {}),
    ],
)
def test_the_flat_record_is_mapped(old, new):
    expected = Settings.of(**{"method": "sart", "nodes": 128, "decomposition": "slices", **new})
    assert from_stored(old) == expected
    assert from_stored({**FLAT, **old}) == expected


def test_a_name_that_no_version_had_is_rejected():
    with pytest.raises(TypeError):
        from_stored({"swept": 1})
    with pytest.raises(InvalidInput, match=r"sart\.relaxation"):
        from_stored({"relaxation": 7})
