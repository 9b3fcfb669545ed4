"""Views from queries: a parameter for each field, with its type, default and meaning."""

import inspect
from dataclasses import fields
from typing import Any, get_args

import pytest
from fastapi.params import Query

from bentray_service.routes.pictures import view_dependency
from bentray_workers.rendering.field_view import FieldView
from bentray_workers.rendering.refraction_view import RefractionView


@pytest.mark.parametrize("kind", [RefractionView, FieldView])
def test_every_field_is_a_parameter(kind: type[Any]) -> None:
    parameters = dict(inspect.signature(view_dependency(kind)).parameters)
    del parameters["request"]
    assert list(parameters) == [field.name for field in fields(kind)]
    for field in fields(kind):
        query = next(one for one in get_args(parameters[field.name].annotation) if isinstance(one, Query))
        assert query.description
        assert query.description.startswith(field.metadata["description"])
        default = parameters[field.name].default
        assert (tuple(default) if isinstance(default, list) else default) == field.default
