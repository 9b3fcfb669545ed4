"""Dependencies that build a view from query parameters, one for each field of a dataclass."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import fields
from typing import Annotated, Any, TypeVar, get_type_hints

from fastapi import Depends, Query, Request

from bentray_kernels.errors import InvalidInput
from bentray_kernels.requests.request_fields import check_used
from bentray_workers.rendering.field_view import FieldView
from bentray_workers.rendering.refraction_view import RefractionView

View = TypeVar("View")


def view_dependency(kind: type[View]) -> Callable[..., View]:
    """A dependency that builds a view from the query.

    It raises InvalidInput for parameters that are unknown or have no effect beside the others.

    Args:
        kind: a dataclass whose fields have a ``description`` in their metadata.
    """
    names = [field.name for field in fields(kind)]  # type: ignore[arg-type]

    def view_of(request: Request, **values: Any) -> View:
        for name in request.query_params:
            if name not in names:
                raise InvalidInput(name, repr(request.query_params[name])[:80], "one of " + ", ".join(names))
        view = kind(**{name: tuple(v) if isinstance(v, list) else v for name, v in values.items()})
        checked: View = check_used(view)
        return checked

    view_of.__signature__ = _signature(kind)  # type: ignore[attr-defined]
    return view_of


def _signature(kind: type[Any]) -> inspect.Signature:
    """The signature for FastAPI: the fields of the view with their descriptions."""
    types = get_type_hints(kind)
    parameters = [inspect.Parameter("request", inspect.Parameter.KEYWORD_ONLY, annotation=Request)]
    for field in fields(kind):
        default: Any = field.default
        several = isinstance(default, tuple)
        annotation: Any = list[float] if several else types[field.name]
        query = Query(
            description=field.metadata["description"] + (" May be repeated." if several else ""),
            json_schema_extra=field.metadata.get("json_schema_extra"),
        )
        parameters.append(
            inspect.Parameter(
                field.name,
                inspect.Parameter.KEYWORD_ONLY,
                default=list(default) if several else default,
                annotation=Annotated[annotation, query],
            )
        )
    return inspect.Signature(parameters)


ViewParameters = Annotated[RefractionView, Depends(view_dependency(RefractionView))]
FieldViewParameters = Annotated[FieldView, Depends(view_dependency(FieldView))]
