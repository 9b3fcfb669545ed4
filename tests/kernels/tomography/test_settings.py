"""The nested settings: values by name, errors by place, choices that the code has; and stored ones."""

import json
import pickle
from dataclasses import fields, is_dataclass

import pytest

from bentray_kernels.acquisition import PICKERS
from bentray_kernels.eikonal import methods
from bentray_kernels.errors import InvalidInput
from bentray_kernels.requests.request_fields import check_used, choices_of
from bentray_kernels.tomography import (
    AttenuationSettings,
    GaussNewtonSettings,
    PickingSettings,
    Settings,
)
from bentray_kernels.tomography.gauss_newton.penalties import PENALTIES
from bentray_kernels.tomography.numerics import Numerics, recorded
from bentray_kernels.tomography.settings import DEVIATION, PLACES, FixedSettings
from bentray_kernels.tomography.stored_settings import FIXED, WITHDRAWN, from_stored


def test_settings_accept_field_names_or_records():
    by_name = Settings.from_values(penalty_strength=0.5, examine=False, attenuation=False)
    by_record = Settings(
        gauss_newton=GaussNewtonSettings(penalty_strength=0.5),
        picking=PickingSettings(examine=False),
        attenuation=AttenuationSettings(enabled=False),
    )
    assert by_name == by_record
    assert by_name.changed(picking=PickingSettings(), attenuation=True).picking == PickingSettings()


def test_numerical_parameters_are_fixed_and_freed():
    fixed = Settings.from_values(nodes=64, subset=4)
    assert isinstance(fixed, FixedSettings)
    assert fixed.numerics == Numerics(subset=4)
    assert pickle.loads(pickle.dumps(fixed)) == fixed != Settings(nodes=64)
    assert fixed.changed(subset=1) == Settings(nodes=64)
    assert fixed.to_dict() == Settings(nodes=64).to_dict()


def test_unknown_names_are_type_errors():
    with pytest.raises(TypeError):
        Settings.from_values(swept=1)


def test_every_setting_has_a_description_a_default_and_a_place():
    found = []
    for one in fields(Settings):
        record = type(one.default) if is_dataclass(one.default) else None
        found += [f"{one.name}.{leaf.name}" for leaf in fields(record)] if record else [one.name]
        for leaf in (one, *(fields(record) if record else ())):
            assert leaf.metadata["description"]
            assert leaf.default is not None or leaf.metadata["unset"]
    assert found == list(PLACES.values())


def test_choices_are_those_of_the_code():
    assert set(choices_of(Settings)["eikonal"]) == {DEVIATION, *methods()}
    assert choices_of(PickingSettings)["picker"] == tuple(PICKERS)
    assert choices_of(Numerics)["penalty"] == PENALTIES


@pytest.mark.parametrize(
    ("values", "field"),
    [
        ({"penalty_strength": -1.0}, "gauss_newton.penalty_strength"),
        ({"penalty": "lp"}, "penalty"),
        ({"amplitudes": "spectrum", "focusing": True}, "focusing"),
        ({"speed_range_mps": (1600.0, 1400.0)}, "speed_range_mps"),
        ({"method": "waveform", "decomposition": "volume"}, "decomposition"),
        ({"nodes": 32, "coarser_grids": 2}, "coarser_grids"),
        ({"minutes": -1.0}, "minutes"),
    ],
)
def test_an_error_names_the_place(values, field):
    with pytest.raises(InvalidInput, match=f"^{field}: found"):
        check_used(Settings.from_values(**values))


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
