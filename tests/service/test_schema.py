"""The whole API against its own description: schemathesis makes the requests, right ones and wrong ones."""

from __future__ import annotations

import io
import json
from collections import Counter
from typing import Any

import httpx
import numpy as np
import pytest
import schemathesis
import trimesh
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st
from hypothesis.errors import Unsatisfiable
from schemathesis import GenerationMode
from schemathesis.checks import not_a_server_error
from schemathesis.specs.openapi.checks import (
    content_type_conformance,
    response_schema_conformance,
    status_code_conformance,
)

from bentray_service.openapi import description

CHECKS = [
    not_a_server_error,
    status_code_conformance,
    content_type_conformance,
    response_schema_conformance,
]
EXAMPLES = 6
# Each of these starts a process that reads what it was sent.
UPLOADS = ("POST /v1/datasets", "POST /v1/volumes", "POST /v1/meshes")
UPLOAD_EXAMPLES = 2
# An honest 5xx: no worker in time, no room on the disk.
HONEST = (503, 507)
STREAM = {"Content-Type": "application/octet-stream"}

# Pieces of uploads are bytes as they are.
schemathesis.serializer.alias("application/offset+octet-stream", "application/octet-stream")


@pytest.fixture
def known(serve, work, scan):
    """The address of a service, and the ids of what it holds by the names of path parameters."""
    address = serve()
    with httpx.Client(base_url=address, timeout=60.0) as http:
        values = io.BytesIO()
        np.save(values, np.arange(60, dtype=np.uint8).reshape(3, 4, 5))
        found = {}
        for name, path, content in (
            ("dataset_id", "/v1/datasets", scan().read_bytes()),
            ("volume_id", "/v1/volumes", values.getvalue()),
            ("mesh_id", "/v1/meshes", trimesh.creation.box().export(file_type="ply")),
        ):
            answer = http.post(path, content=content, headers=STREAM)
            assert answer.status_code == 201, answer.text
            found[name] = answer.json()["id"]
        asked = {"kind": "reconstruction", "dataset": found["dataset_id"], "settings": {"nodes": 16}}
        found["job_id"] = http.post("/v1/jobs", json=asked).json()["id"]
    return address, found


def attack(
    address: str, operation: Any, mode: GenerationMode, known: dict[str, str], came: Counter[int]
) -> list[str]:
    """What is wrong with the answers to requests of one kind; ``came`` counts each status."""
    count = UPLOAD_EXAMPLES if operation.label in UPLOADS else EXAMPLES

    @settings(
        max_examples=count,
        derandomize=True,
        database=None,
        deadline=None,
        phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )
    @given(case=operation.as_strategy(generation_mode=mode), real=st.booleans())
    def ask(case: Any, real: bool) -> None:
        if real and case.path_parameters:
            case.path_parameters |= {k: v for k, v in known.items() if k in case.path_parameters}
        if real and isinstance(case.body, dict) and "dataset" in case.body:
            case.body["dataset"] = known["dataset_id"]
        answer = case.call(base_url=address, timeout=60.0)
        came[answer.status_code] += 1
        if answer.status_code not in HONEST:
            case.validate_response(answer, checks=CHECKS)
        # By its own number: what the description says of all others would let any through.
        assert str(answer.status_code) in operation.definition.raw["responses"], (
            f"{answer.status_code} is not described: {answer.text[:300]}"
        )

    try:
        ask()
    except Unsatisfiable:
        # Nothing can be wrong with a request that takes nothing.
        return []
    except BaseException as error:  # schemathesis groups its failures
        return [f"{operation.label} ({mode.value}): {part}" for part in getattr(error, "exceptions", [error])]
    return []


@pytest.mark.slow
def test_every_answer_is_one_of_those_described(known):
    address, found = known
    schema = schemathesis.openapi.from_dict(json.loads(description()))
    operations = [one.ok() for one in schema.get_all_operations()]
    assert len(operations) > 30
    # What deletes comes last, so that the others have something to ask for.
    operations.sort(key=lambda one: one.method.upper() == "DELETE")
    faults: list[str] = []
    came: Counter[int] = Counter()
    for operation in operations:
        for mode in GenerationMode:
            faults += attack(address, operation, mode, found, came)
    assert not faults, "\n\n".join(faults)
    # Requests got through to the work, and to refusals of several kinds.
    assert {200, 204, 404, 422} <= set(came), came
    assert came[200] > 50
    with httpx.Client(base_url=address) as http:
        assert http.get("/health/live").status_code == 200
