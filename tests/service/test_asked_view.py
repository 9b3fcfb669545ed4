"""Views from queries: a parameter for each field, with its type, default and meaning."""

from __future__ import annotations

import inspect
from dataclasses import fields
from typing import get_args

import pytest
from fastapi import Request
from fastapi.params import Query

from bentray_kernels.errors import InvalidInput
from bentray_service.asked_view import view_of
from bentray_workers.refraction_view import RefractionView


def asked(query: bytes) -> Request:
    return Request({"type": "http", "query_string": query, "headers": []})


def test_every_field_is_a_parameter() -> None:
    parameters = dict(inspect.signature(view_of).parameters)
    del parameters["request"]
    assert list(parameters) == [field.name for field in fields(RefractionView)]
    for field in fields(RefractionView):
        query = next(one for one in get_args(parameters[field.name].annotation) if isinstance(one, Query))
        assert query.description
        assert query.description.startswith(field.metadata["description"])
        default = parameters[field.name].default
        assert (tuple(default) if isinstance(default, list) else default) == field.default


def test_lists_become_tuples() -> None:
    view = view_of(asked(b"iso=1&iso=2"), iso=[1.0, 2.0], index=[1.1, 1.2])
    assert view == RefractionView(iso=(1.0, 2.0), index=(1.1, 1.2))


def test_a_parameter_that_does_not_exist_is_named() -> None:
    with pytest.raises(InvalidInput, match=r"isos: found '1'; accepted: one of iso, index"):
        view_of(asked(b"isos=1"))
