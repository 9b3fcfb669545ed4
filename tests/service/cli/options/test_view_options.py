"""The options of views and of a geometry field: one for each field; rows of numbers repeat an option."""

from dataclasses import fields
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bentray_kernels.requests.request_fields import choices_of
from bentray_kernels.splines import FILTERS
from bentray_service.cli.options.view_options import (
    FIELD_SETTINGS,
    FIELD_VIEW,
    VIEW,
    field_of,
    repeat_option,
    view_of,
)
from bentray_workers.rendering.field_settings import FieldSettings
from bentray_workers.rendering.field_view import FieldView
from bentray_workers.rendering.refraction_view import RefractionView


@pytest.mark.parametrize(
    ("options", "kind"), [(VIEW, RefractionView), (FIELD_SETTINGS, FieldSettings), (FIELD_VIEW, FieldView)]
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
    assert view_of({}) == (RefractionView(), None)
    view, _ = view_of({"iso": [0.5, 0.7], "index": [1.2, 1.3], "fresnel": True})
    assert view == RefractionView(iso=(0.5, 0.7), index=(1.2, 1.3), fresnel=True)


def test_each_option_of_a_field_sets_its_own() -> None:
    asked = field_of({"samples": 8, "mode": "refract"})
    assert asked == (FieldSettings(samples=8), FieldView(mode="refract"))
    _, placed = field_of({"scene": "two-mirrors", "positions_m": [0.0, 1.0, 2.0, 3.0]})
    assert placed.positions_m == (0.0, 1.0, 2.0, 3.0)


def test_a_backdrop_may_be_a_file() -> None:
    view, file = view_of({"backdrop": "garden.jpg"})
    assert (view.backdrop, file) == ("picture", Path("garden.jpg"))
    assert view_of({"backdrop": "picture"})[1] is None


def test_the_names_of_filters_are_those_of_the_splines() -> None:
    assert choices_of(RefractionView)["filter"] == tuple(FILTERS)


@pytest.mark.parametrize(
    ("words", "meant"),
    [
        ("-s 1", "-s 1"),
        ("-s 1 2 3", "-s 1 -s 2 -s 3"),
        ("-s 1 2 3 4", "-s 1 -s 2 -s 3 4"),
        ("a -s 1e-3 v.raw 5", "a -s 1e-3 v.raw 5"),
        ("-s 1 -s 2 -s 3", "-s 1 -s 2 -s 3"),
        ("-s many 2", "-s many -s 2"),
        ("-s 1 -2 -o p", "-s 1 -s -2 -o p"),
        ("-s", "-s"),
    ],
)
def test_rows(words: str, meant: str) -> None:
    assert list(repeat_option("-s", words.split())) == meant.split()


@given(st.lists(st.text(max_size=4).filter(lambda word: word != "-s")))
def test_without_the_option_nothing_changes(words: list[str]) -> None:
    assert list(repeat_option("-s", words)) == words
