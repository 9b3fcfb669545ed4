"""The routes and records of the REST API, from its OpenAPI description."""

import functools
import tempfile
from pathlib import Path
from typing import Any

from bentray_service.app import create_app
from bentray_service.settings import ServiceSettings
from bentray_service.web.reference import type_words

from .tables import table

Node = dict[str, Any]


@functools.cache
def document() -> Node:
    """The content of `/openapi.json`."""
    with tempfile.TemporaryDirectory() as folder:
        return dict(create_app(ServiceSettings(data_dir=Path(folder))).openapi())


def routes() -> str:
    """One section per route and method, in the order of the description."""
    return "\n\n".join(
        _route(method, path, operation)
        for path, methods in document()["paths"].items()
        for method, operation in methods.items()
    )


def records() -> str:
    """One section per schema: its fields, types and meanings."""
    schemas = document()["components"]["schemas"]
    return "\n\n".join(_record(name, schemas[name]) for name in sorted(schemas))


def _route(method: str, path: str, operation: Node) -> str:
    parts = [f"### {method.upper()} {path}", _plain(operation.get("description", ""))]
    if given := operation.get("parameters"):
        rows = [
            (f"`{one['name']}`", one["in"], _type(one["schema"]), _plain(one.get("description", "")))
            for one in given
        ]
        parts.append(table(("parameter", "in", "type", "meaning"), rows))
    if body := operation.get("requestBody"):
        kinds = [f"{_type(content['schema'])} as `{media}`" for media, content in body["content"].items()]
        parts.append("Body: " + "; ".join(kinds) + ".")
    parts.append("Responses: " + ", ".join(_responses(operation["responses"])) + ".")
    return "\n\n".join(part for part in parts if part)


def _responses(responses: Node) -> list[str]:
    found = []
    for code, answer in sorted(responses.items()):
        if code == "default":
            continue
        kinds = {
            _type(content.get("schema", {})) if media.endswith("json") else f"`{media}`"
            for media, content in answer.get("content", {}).items()
        }
        found.append(f"{code} " + (f"({' or '.join(sorted(kinds))})" if kinds else ""))
    return [one.strip() for one in found]


def _record(name: str, schema: Node) -> str:
    needed = schema.get("required", [])
    rows = [
        (f"`{field}`", _type(what), _default(field, what, needed), _plain(what.get("description", "")))
        for field, what in schema.get("properties", {}).items()
    ]
    about = _plain(schema.get("description", "").split("\n\n")[0])
    return "\n\n".join([f"### {name}", about, table(("field", "type", "default", "meaning"), rows)])


def _default(field: str, what: Node, needed: list[str]) -> str:
    if field in needed:
        return "required"
    return f"`{what['default']}`" if what.get("default") is not None else ""


def _type(schema: Node) -> str:
    return _plain(type_words(schema))


def _plain(text: str) -> str:
    """Text on one line with escaped angle brackets and stars."""
    return " ".join(text.replace("<", "&lt;").replace("*", "\\*").split())
