"""The OpenAPI description without null types of parameters."""

from __future__ import annotations

from typing import Any

from fastapi import FastAPI


class OpenApiApp(FastAPI):
    """A FastAPI application whose description has no null parameters.

    FastAPI describes an optional parameter with the default None as null, but queries and headers cannot be
    null.
    """

    def openapi(self) -> dict[str, Any]:
        """The description, generated once."""
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
