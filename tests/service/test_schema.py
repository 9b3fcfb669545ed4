"""The whole API against its own description: schemathesis makes the requests, right ones and wrong ones."""

import json
import os
import secrets
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import httpx
import numpy as np
import pytest
import trimesh

from bentray_service.openapi import description
from bentray_service.rows.keys import ApiKey

from ..effort import effort
from .conftest import STREAM, created, npy

HERE = Path(__file__).parent

# Every check of schemathesis is on but two, in whose place ours of schema_checks stand.
METHODS = ("get", "post", "put", "patch", "delete", "head", "options", "trace")
CONFIG = """
base-url = "{address}"
hooks = "schema_checks"
request-timeout = 60.0
continue-on-failure = true
suppress-health-check = ["all"]
warnings = false
headers = {{ Authorization = "Bearer {key}" }}

[checks]
positive_data_acceptance = {{ enabled = false }}
negative_data_rejection = {{ enabled = false, expected-statuses = [
  "400", "401", "403", "404", "405", "409", "413", "415", "422", "429", "503", "507",
  # tus answers so what speaks another version of it, and a wrong checksum.
  "412", "460",
] }}
# An honest 5xx: no worker in time, no room on the disk.
not_a_server_error = {{ expected-statuses = ["2xx", "3xx", "4xx", "503", "507"] }}

[generation]
database = "none"

# What deletes makes ids of its own, or takes those of what it made.
[[operations]]
include-method-regex = "GET|POST|PATCH"
parameters = {{ {ids} }}

# One sequence of requests may delete a job that it found in the list of jobs and another has just made.
[[operations]]
include-path-regex = "^/v1/jobs/"
checks = {{ ensure_resource_availability = {{ enabled = false }} }}
"""
# The systematic requests of these, one a bound of each parameter, are a thousand, draw large pictures, or
# wait for the end of a stream.
MANY = """
[[operations]]
include-path-regex = "/(jobs|plans|batches)$|[.]png$|^/v1/uploads$|/events$"
phases = { coverage = { enabled = false } }
"""


@pytest.fixture
def attack(serve, scan, tmp_path) -> Callable[..., tuple[int, str]]:
    """Run schemathesis with options against a service that asks for a key and holds one of most things."""
    token = ApiKey.new()
    key = tmp_path / "key"
    key.touch(0o600)
    key.write_text(token.shown())
    # Jobs stay where they are: no disk has so much room.
    address = serve(
        first_key_file=key,
        requests_per_minute=0,
        renders_per_minute=0,
        max_queued_jobs=100_000,
        min_free_bytes=2**60,
    )
    values = npy(np.arange(60, dtype=np.uint8).reshape(3, 4, 5))
    found = {}
    with httpx.Client(
        base_url=address, timeout=60.0, headers={"Authorization": f"Bearer {token.shown()}"}
    ) as http:
        for name, path, content in (
            ("dataset_id", "/v1/datasets", scan().read_bytes()),
            ("volume_id", "/v1/volumes", values),
            ("mesh_id", "/v1/meshes", trimesh.creation.box().export(file_type="ply")),
        ):
            found[name] = created(http.post(path, content=content, headers=STREAM))["id"]
        asked = {
            "kind": "reconstruction",
            "dataset": found["dataset_id"],
            "settings": {"method": "sart", "nodes": 16},
        }
        found["job_id"] = http.post("/v1/jobs", json=asked).json()["id"]
    ids = ", ".join(f'"path.{name}" = "{value}"' for name, value in found.items())
    # Of streams of events.
    ids += ', "query.seconds" = 1'
    given = CONFIG.format(address=address, key=token.shown(), ids=ids)
    schema = tmp_path / "openapi.json"
    schema.write_text(description())

    def run(*options: str, more: str = "") -> tuple[int, str]:
        config = tmp_path / "schemathesis.toml"
        config.write_text(given + more)
        command = [sys.executable, "-m", "schemathesis.cli", "--config-file", config, "run", schema]
        done = subprocess.run(
            [*command, "--no-color", *options],
            cwd=tmp_path,
            env={**os.environ, "PYTHONPATH": str(HERE)},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            check=False,
        )
        # The service lives on, whatever it was asked.
        assert httpx.get(f"{address}/health/live").status_code == 200
        return done.returncode, done.stdout

    return run


@pytest.mark.nightly
@pytest.mark.slow
def test_every_answer_is_one_of_those_described(attack):
    failed, words = attack("--generation-deterministic", f"--max-examples={effort(1, 4)}", more=MANY)
    assert not failed, words
    # Every operation was asked, and what was made was followed by its links: read, deleted, read again.
    operations = sum(
        method in METHODS for path in json.loads(description())["paths"].values() for method in path
    )
    assert operations > 35
    assert f"Tested: {operations}" in words
    assert "Stateful" in words


@pytest.mark.nightly
def test_random_requests_match_the_schema(attack, request):
    given = request.config.getoption("--hypothesis-seed")
    seed = secrets.randbits(32) if given is None else given
    failed, words = attack(f"--seed={seed}", "--max-examples=60")
    again = f"pytest {request.node.nodeid} --hypothesis-seed={seed}"
    assert not failed, f"{words}\nRepeat it with: {again}"
