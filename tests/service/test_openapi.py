"""The committed openapi.json is what the service says of itself."""

import json
from pathlib import Path

from bentray_service.openapi import description

COMMITTED = Path(__file__).parents[2] / "openapi.json"


def test_committed_description_is_up_to_date():
    advice = "run: python -m bentray_service.openapi > openapi.json"
    assert COMMITTED.read_text(encoding="utf-8") == description(), advice


def test_every_address_of_the_plan_is_there():
    paths = json.loads(description())["paths"]
    for path in (
        "/v1/datasets",
        "/v1/datasets/{dataset_id}",
        "/v1/jobs",
        "/v1/jobs/{job_id}",
        "/v1/jobs/{job_id}/cancel",
        "/v1/volumes",
        "/v1/volumes/{volume_id}",
        "/v1/volumes/{volume_id}/slice.png",
        "/v1/volumes/{volume_id}/data",
        "/v1/volumes/{volume_id}/refraction.png",
        "/v1/volumes/{volume_id}/mesh",
        "/v1/meshes",
        "/v1/meshes/{mesh_id}",
        "/v1/geometry-fields",
        "/v1/geometry-fields/{field_id}",
        "/v1/geometry-fields/{field_id}/image.png",
        "/v1/geometry-fields/{field_id}/geometry-image.png",
        "/v1/geometry-fields/{field_id}/normal-map.png",
        "/health/live",
        "/health/ready",
    ):
        assert path in paths


def test_settings_of_a_job_are_described():
    settings = json.loads(description())["components"]["schemas"]["Settings"]["properties"]
    assert {"rays", "eikonal", "nodes", "sweeps"} <= set(settings)
