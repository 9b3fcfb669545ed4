"""Each parameter of a GET request is refused outside its description: by name, with what is accepted."""

import json
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

from bentray_service.openapi import description
from bentray_service.rows.ids import new_id

from .conftest import STREAM, npy

Schema = dict[str, Any]


def wrong_values(schema: Schema) -> Iterator[tuple[str, str]]:
    """Texts outside a schema, each with a text of what is accepted."""
    if "items" in schema:
        yield from wrong_values(schema["items"])
    elif "enum" in schema:
        yield "no such choice", str(schema["enum"][0])
    elif schema["type"] == "boolean":
        yield "perhaps", "boolean"
    elif schema["type"] in ("integer", "number"):
        yield from (("many", "number" if schema["type"] == "number" else "integer"), ("nan", ""))
        if schema["type"] == "integer":
            yield "1.5", "integer"
        for name, step in (("minimum", -1), ("maximum", 1)):
            if name in schema:
                beyond = schema[name] + step * max(1, 1e-3 * abs(schema[name]))
                yield str(int(beyond) if schema["type"] == "integer" else beyond), ""
    elif "maxLength" in schema:
        yield "x" * (schema["maxLength"] + 1), str(schema["maxLength"])
    if schema.get("pattern", "").startswith("^[^\\u0000]"):
        yield "a\0b", ""


def parameters() -> Iterator[tuple[str, str, Schema]]:
    """Path, name and schema of each parameter of a query."""
    for path, operations in json.loads(description())["paths"].items():
        for parameter in operations.get("get", {}).get("parameters", ()):
            if parameter["in"] == "query":
                yield path, parameter["name"], parameter["schema"]


@pytest.fixture
def places(start: Callable[..., Any], uploaded: Callable[[Any], str]) -> tuple[Any, dict[str, str]]:
    """A service, and an id for each placeholder of a path."""
    http = start()
    content = npy(np.arange(60, dtype=np.uint8).reshape(3, 4, 5))
    volume = http.post("/v1/volumes", content=content, headers=STREAM).json()["id"]
    unknown = {f"{kind}_id": new_id(kind) for kind in ("mesh", "field")}
    return http, {"dataset_id": uploaded(http), "volume_id": volume, **unknown}


def test_every_parameter_is_refused_outside_its_description(places, cluster) -> None:
    http, ids = places
    tried, wrong = 0, []
    for path, name, schema in parameters():
        for value, accepted in wrong_values(schema):
            answer = http.get(path.format(**ids), params={name: value})
            body = answer.json()
            result = (answer.status_code, body.get("field", "").partition(".")[0])
            if result != (422, name) or accepted not in body["accepted"] or not body["accepted"]:
                wrong.append((path, name, value, accepted, answer.status_code, body.get("detail")))
            tried += 1
    assert not wrong, "\n".join(map(str, wrong))
    assert tried > 200
    assert not cluster.submitted
