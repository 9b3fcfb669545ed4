"""The options of views and of a geometry field: one for each field, with its default and its choices."""

from dataclasses import fields
from pathlib import Path

import pytest

from bentray_kernels.requests.request_fields import choices_of
from bentray_kernels.splines import FILTERS
from bentray_service.cli.options.field_options import SETTINGS, VIEW, FieldOptions
from bentray_service.cli.options.view_options import OPTIONS, ViewOptions
from bentray_workers.rendering.field_settings import FieldSettings
from bentray_workers.rendering.field_view import FieldView
from bentray_workers.rendering.refraction_view import RefractionView


@pytest.mark.parametrize(
    ("options", "kind"), [(OPTIONS, RefractionView), (SETTINGS, FieldSettings), (VIEW, FieldView)]
)
def test_every_field_has_an_option_with_default_and_choices(options, kind) -> None:
    assert list(options) == [field.name for field in fields(kind)]
    words = {"False": "no", "(1.5,)": "1.5"}
    for field in fields(kind):
        option = options[field.name]
        shown = words.get(str(field.default), str(field.default))
        assert option.default == (field.metadata["unset"] if field.default in (None, ()) else shown)
        shown = option.help + (option.metavar or "")
        assert all(choice in shown for choice in choices_of(kind).get(field.name, ()))


def test_omitted_options_take_defaults() -> None:
    assert ViewOptions({}).view() == (RefractionView(), None)
    asked = ViewOptions({"iso": [0.5, 0.7], "index": [1.2, 1.3], "fresnel": True})
    assert asked.view()[0] == RefractionView(iso=(0.5, 0.7), index=(1.2, 1.3), fresnel=True)


def test_each_option_of_a_field_sets_its_own() -> None:
    asked = FieldOptions({"samples": 8, "mode": "refract"})
    assert asked.settings() == FieldSettings(samples=8)
    assert asked.view() == FieldView(mode="refract")
    placed = FieldOptions({"scene": "two-mirrors", "positions_m": [0.0, 1.0, 2.0, 3.0]})
    assert placed.view().positions_m == (0.0, 1.0, 2.0, 3.0)


def test_a_backdrop_may_be_a_file() -> None:
    view, file = ViewOptions({"backdrop": "garden.jpg"}).view()
    assert (view.backdrop, file) == ("picture", Path("garden.jpg"))
    assert ViewOptions({"backdrop": "picture"}).view()[1] is None


def test_the_names_of_filters_are_those_of_the_splines() -> None:
    assert choices_of(RefractionView)["filter"] == tuple(FILTERS)
