"""The options of a geometry field: one for each field of its settings and its view, with the same default."""

from __future__ import annotations

from dataclasses import fields

import pytest

from bentray_kernels.errors import InvalidInput
from bentray_service.cli.options.field_options import OPTIONS, SETTINGS, VIEW, FieldOptions
from bentray_workers.rendering.field_settings import FieldSettings
from bentray_workers.rendering.field_view import CHOICES, FieldView


@pytest.mark.parametrize(("options", "kind"), [(SETTINGS, FieldSettings), (VIEW, FieldView)])
def test_every_field_has_an_option_with_its_default(options, kind) -> None:
    assert list(options) == [field.name for field in fields(kind)]
    assert {name: option.default for name, option in options.items()} == {
        field.name: field.metadata.get("unset") or str(field.default) for field in fields(kind)
    }


def test_the_help_names_every_choice() -> None:
    for name, choices in CHOICES.items():
        if name != "eye":
            assert all(choice in OPTIONS[name].help for choice in choices), name


def test_each_option_sets_its_own_field() -> None:
    asked = FieldOptions({"samples": 8, "mode": "refract"})
    assert asked.settings() == FieldSettings(samples=8)
    assert asked.view() == FieldView(mode="refract")
    placed = FieldOptions({"scene": "two-mirrors", "positions_m": [0.0, 1.0, 2.0, 3.0]})
    assert placed.view().positions_m == (0.0, 1.0, 2.0, 3.0)


def test_a_wrong_value_is_named() -> None:
    with pytest.raises(InvalidInput, match="scene"):
        FieldOptions({"scene": "moon"}).view()
    with pytest.raises(InvalidInput, match="samples"):
        FieldOptions({"samples": 99}).settings()
