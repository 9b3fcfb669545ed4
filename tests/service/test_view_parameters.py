"""Views from queries: a parameter for each field, with its type, default and meaning."""

import inspect
from dataclasses import fields
from typing import Any, get_args

import pytest
from fastapi import Request
from fastapi.params import Query

from bentray_kernels.errors import InvalidInput
from bentray_service.view_parameters import view_dependency
from bentray_workers.rendering.field_view import FieldView
from bentray_workers.rendering.refraction_view import RefractionView


def asked(query: bytes) -> Request:
    return Request({"type": "http", "query_string": query, "headers": []})


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


def test_lists_become_tuples() -> None:
    view = view_dependency(RefractionView)(asked(b"iso=1&iso=2"), iso=[1.0, 2.0], index=[1.1, 1.2])
    assert view == RefractionView(iso=(1.0, 2.0), index=(1.1, 1.2))


def test_a_parameter_that_does_not_exist_is_named() -> None:
    with pytest.raises(InvalidInput, match=r"isos: found '1'; accepted: one of iso, index"):
        view_dependency(RefractionView)(asked(b"isos=1"))
    with pytest.raises(InvalidInput, match=r"iso: found '1'; accepted: one of scene, mode"):
        view_dependency(FieldView)(asked(b"iso=1"))
