"""The nested settings: values by their own names, errors by their places, choices that the code has."""

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
from bentray_kernels.tomography.numerics import Numerics
from bentray_kernels.tomography.settings import DEVIATION, PLACES, FixedSettings


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
    with pytest.raises(InvalidInput) as error:
        check_used(Settings.from_values(**values))
    assert error.value.field == field
