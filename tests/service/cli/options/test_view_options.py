"""The options of a view: one for each field, with the field's own default."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path

import pytest

from bentray_kernels.errors import InvalidInput
from bentray_service.cli.options.view_options import OPTIONS, ViewOptions
from bentray_workers.rendering.refraction_view import RefractionView


def test_every_field_has_an_option_with_its_default() -> None:
    assert list(OPTIONS) == [field.name for field in fields(RefractionView)]
    for field in fields(RefractionView):
        if field.name == "iso":
            continue
        default = field.default[0] if isinstance(field.default, tuple) else field.default
        assert OPTIONS[field.name].default == (field.metadata["unset"] if default is None else str(default))


def test_omitted_options_take_defaults() -> None:
    assert ViewOptions({}).view() == (RefractionView(), None)
    asked = ViewOptions({"iso": [0.5, 0.7], "index": [1.2, 1.3], "fresnel": True})
    assert asked.view()[0] == RefractionView(iso=(0.5, 0.7), index=(1.2, 1.3), fresnel=True)


def test_a_backdrop_may_be_a_file() -> None:
    view, file = ViewOptions({"backdrop": "garden.jpg"}).view()
    assert (view.backdrop, file) == ("picture", Path("garden.jpg"))
    assert ViewOptions({"backdrop": "picture"}).view()[1] is None


def test_a_wrong_value_is_named() -> None:
    with pytest.raises(InvalidInput, match="camera"):
        ViewOptions({"camera": "fisheye"}).view()
