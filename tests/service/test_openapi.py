"""The committed openapi.json equals the schema of the service; a parameter for each field of a view."""

import inspect
import json
import re
import shlex
from dataclasses import fields
from pathlib import Path
from typing import Any, get_args

import pytest
from fastapi.params import Query
from pydantic import TypeAdapter

from bentray_service.openapi import description
from bentray_service.routes.jobs import JobRequest
from bentray_service.routes.models.batch_records import BatchRequest
from bentray_service.routes.models.name_changes import DatasetChanges, JobChanges, ScanCorrection
from bentray_service.routes.models.project_records import MemberRequest, ProjectRequest
from bentray_service.routes.models.upload_records import DirectUploadRequest, PartsRequest
from bentray_service.routes.pictures import view_dependency
from bentray_workers.rendering.field_view import FieldView
from bentray_workers.rendering.refraction_view import RefractionView

COMMITTED = Path(__file__).parents[2] / "openapi.json"


def test_committed_description_is_up_to_date():
    advice = "run: python -m bentray_service.openapi > openapi.json"
    assert COMMITTED.read_text(encoding="utf-8") == description(), advice


def operations():
    """(name, description) of each."""
    for path, methods in json.loads(description())["paths"].items():
        for method, operation in methods.items():
            yield f"{method.upper()} {path}", operation


def test_every_operation_has_a_description():
    named = dict(operations())
    assert all(one["summary"] and one["description"] and one["tags"] for one in named.values())
    assert len({operation["operationId"] for operation in named.values()}) == len(named)


def test_every_parameter_but_ids_is_explained():
    for name, operation in operations():
        for parameter in operation.get("parameters", []):
            assert parameter["in"] == "path" or parameter.get("description"), (name, parameter)


def test_every_error_response_is_described():
    for name, operation in operations():
        said = operation["responses"]
        where = {parameter["in"] for parameter in operation.get("parameters", [])}
        if where & {"query", "header"} or "requestBody" in operation:
            assert "422" in said, name
        if "path" in where:
            assert "404" in said, name
        if "requestBody" in operation:
            assert {"413", "415"} <= set(said), name
        for status, answer in said.items():
            assert answer["description"], (name, status)
            if status >= "4":
                assert list(answer["content"]) == ["application/problem+json"], (name, status)


def test_every_json_body_has_examples_that_are_taken():
    models = (
        *(BatchRequest, DatasetChanges, JobChanges, MemberRequest, ProjectRequest),
        *(DirectUploadRequest, PartsRequest, ScanCorrection),
    )
    changes = {f"#/components/schemas/{model.__name__}": model for model in models}
    result = 0
    for _, operation in operations():
        content = operation.get("requestBody", {}).get("content", {}).get("application/json")
        if content is not None:
            taken = TypeAdapter(changes.get(content["schema"].get("$ref"), JobRequest))
            for example in content["examples"].values():
                taken.validate_python(example["value"])
                result += 1
    assert result >= 5


def test_every_operation_has_an_example_by_curl():
    server = json.loads(description())["servers"][0]
    address = server["url"].format(address=server["variables"]["address"]["default"])
    for name, operation in operations():
        method, path = name.split()
        (sample,) = operation["x-codeSamples"]
        words = shlex.split(sample["source"])
        assert words[0] == "curl"
        assert re.fullmatch(re.sub(r"\{\w+\}", r"[a-z]+-…", address + path), words[-1]), name
        sends = {"-d", "--data-binary"} & set(words)
        assert bool(sends) == ("requestBody" in operation), name
        assert method == (words[words.index("-X") + 1] if "-X" in words else "POST" if sends else "GET")
        headers = [words[at + 1] for at, word in enumerate(words) if word == "-H"]
        needed = {
            parameter["name"]
            for parameter in operation.get("parameters", ())
            if parameter.get("required") and parameter["in"] != "path"
        }
        assert needed <= {header.partition(":")[0].lower() for header in headers}, name
        assert "None" not in " ".join(headers), name


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
