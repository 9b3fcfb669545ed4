"""The OpenAPI description as FastAPI makes it, but for parameters, which are left out and never null."""

from __future__ import annotations

from typing import Any

from fastapi import FastAPI


class OpenApiApp(FastAPI):
    """An application whose description calls no parameter null.

    A parameter that may be left out has the default None in Python, which FastAPI describes as null; a query
    or a header can only hold the text "null".
    """

    def openapi(self) -> dict[str, Any]:
        """The description; made once."""
        made = self.openapi_schema is None
        document = super().openapi()
        if made:
            _drop_null(document)
        return document


def _drop_null(document: dict[str, Any]) -> None:
    for operations in document["paths"].values():
        for operation in operations.values():
            for parameter in operation.get("parameters", ()):
                schema = parameter["schema"]
                kinds = [one for one in schema.pop("anyOf", ()) if one != {"type": "null"}]
                if len(kinds) == 1:
                    parameter["schema"] = {**kinds[0], **schema}
                elif kinds:
                    schema["anyOf"] = kinds
