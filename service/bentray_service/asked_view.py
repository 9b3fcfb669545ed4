"""Views as people ask for them: one query parameter a field, each known, all of them checked."""

from __future__ import annotations

import inspect
from dataclasses import fields
from typing import Annotated, Any, get_type_hints

from fastapi import Depends, Query, Request

from bentray_kernels.errors import InvalidInput
from bentray_workers.refraction_view import RefractionView

NAMES = [field.name for field in fields(RefractionView)]


def view_of(request: Request, **given: Any) -> RefractionView:
    """The view that a query asks for.

    Raises:
        InvalidInput: for a parameter that does not exist, and from the view itself.
    """
    for name in request.query_params:
        if name not in NAMES:
            raise InvalidInput(name, repr(request.query_params[name])[:80], "one of " + ", ".join(NAMES))
    asked: dict[str, Any] = {name: tuple(v) if isinstance(v, list) else v for name, v in given.items()}
    return RefractionView(**asked)


def _signature() -> inspect.Signature:
    """What FastAPI reads the parameters from: those of the view, with their meanings."""
    types = get_type_hints(RefractionView)
    found = [inspect.Parameter("request", inspect.Parameter.KEYWORD_ONLY, annotation=Request)]
    for field in fields(RefractionView):
        default: Any = field.default
        several = isinstance(default, tuple)
        kind: Any = list[float] if several else types[field.name]
        query = Query(description=field.metadata["description"] + (" May be repeated." if several else ""))
        found.append(
            inspect.Parameter(
                field.name,
                inspect.Parameter.KEYWORD_ONLY,
                default=list(default) if several else default,
                annotation=Annotated[kind, query],
            )
        )
    return inspect.Signature(found)


view_of.__signature__ = _signature()  # type: ignore[attr-defined]

AskedView = Annotated[RefractionView, Depends(view_of)]
