"""Extreme numbers wherever a request takes one: refused by name, or answered; never a 500."""

import json
from itertools import product

import numpy as np
import pytest

from bentray_kernels.requests.ranges import RANGE
from bentray_kernels.tomography.settings import Settings
from bentray_service.openapi import description
from bentray_workers.rendering.field_settings import FieldSettings
from bentray_workers.rendering.turntable import Turntable
from bentray_workers.simulation.request import PhantomScan

from ..extremes import EXTREMES
from .conftest import STREAM, npy

JSON = {"Content-Type": "application/json"}
KINDS = {
    "reconstruction": Settings,
    "simulation": PhantomScan,
    "refraction": Turntable,
    "geometry-field": FieldSettings,
}
# Numbers whose range depends on another one, and lists of them.
OTHERS = {
    "reconstruction": ("speed_bounds_mps",),
    "refraction": ("iso", "index", "surroundings"),
}


@pytest.fixture
def http(start):
    # Jobs stay where they are: no disk has so much room.
    return start(max_queued_jobs=10_000, min_free_bytes=2**60)


@pytest.fixture
def volume(http):
    content = npy(np.arange(60, dtype=np.uint8).reshape(3, 4, 5))
    return http.post("/v1/volumes", content=content, headers=STREAM).json()


def numbers_of(kind):
    ranged = [name for name, value in KINDS[kind].__dataclass_fields__.items() if RANGE in value.metadata]
    inner = [
        f"{record}.{name}"
        for record, outer in KINDS[kind].__dataclass_fields__.items()
        for name, value in getattr(outer.default, "__dataclass_fields__", {}).items()
        if RANGE in value.metadata
    ]
    return [*ranged, *inner, *OTHERS.get(kind, ())]


def refused_by_name(answer, name):
    """A 422 whose field ends in the name of what was wrong; a name of one letter more is no other field."""
    problem = answer.json()
    assert answer.status_code == 422, answer.text[:400]
    assert name in problem["field"], problem
    assert len(answer.content) < 4000


# Every record has its ranges tested (``test_refused_settings``); here is the way through JSON.
@pytest.mark.parametrize(
    "kind",
    [pytest.param(kind, marks=[] if kind == "simulation" else [pytest.mark.nightly]) for kind in KINDS],
)
def test_an_extreme_setting_of_a_job_is_rejected_or_taken(http, uploaded, volume, work, kind):
    named = {"reconstruction": {"dataset": uploaded(http)}, "refraction": {"volume": volume["id"]}}
    refused = 0
    for name in numbers_of(kind):
        for value in (*EXTREMES, list(EXTREMES[:2]), "1e999", "9" * 400):
            record, _, leaf = name.rpartition(".")
            settings = {record: {leaf: value}} if record else {name: value}
            asked = {"kind": kind, "settings": settings, **named.get(kind, {})}
            if kind == "geometry-field":
                asked["mesh"] = "mesh-0123456789abcdef0123"
            answer = http.post("/v1/jobs", content=json.dumps(asked), headers=JSON)
            if answer.status_code == 422:
                refused_by_name(answer, leaf.split("_")[0])
                refused += 1
            else:
                # There is no such mesh; what was asked of it was right.
                assert answer.status_code in (202, 404), answer.text[:400]
    assert refused > 10 * len(numbers_of(kind))


def test_an_extreme_number_of_a_slice(http, volume):
    for name, value in product(("low", "high", "index", "size"), EXTREMES):
        answer = http.get(volume["links"]["image"], params={name: str(value)})
        if answer.status_code != 200:
            refused_by_name(answer, name)


def test_colours_over_all_numbers_are_rejected(http, volume):
    answer = http.get(volume["links"]["image"], params={"low": "-1e308", "high": "1e308"})
    refused_by_name(answer, "low")
    wide = http.get(volume["links"]["image"], params={"low": "-3e38", "high": "3e38"})
    assert wide.status_code == 200
    for low, high in (("0", "5e-324"), ("1", "1.0000000000000002"), ("-0.0", "0.0")):
        refused_by_name(http.get(volume["links"]["image"], params={"low": low, "high": high}), "low")


@pytest.mark.nightly
def test_every_number_of_a_query_or_header_has_bounds(http, volume):
    """Each is drawn from the description, so that a new one is held against the extremes too."""
    rendered = 0
    for path, operations in json.loads(description())["paths"].items():
        parameters = operations.get("get", {}).get("parameters", ())
        # A picture takes as long as it is large.
        small = {query["name"]: "16" for query in parameters if query["name"] in ("width", "height")}
        for parameter in parameters:
            types = [parameter["schema"], *parameter["schema"].get("anyOf", ())]
            if parameter["in"] != "query" or not {"integer", "number"} & {item.get("type") for item in types}:
                continue
            where = path.format(
                volume_id=volume["id"],
                **dict.fromkeys(("dataset_id", "job_id", "field_id", "mesh_id"), "none"),
            )
            for value in EXTREMES:
                answer = http.get(where, params={**small, parameter["name"]: str(value)})
                assert answer.status_code in (200, 404, 422), (path, parameter["name"], answer.text[:300])
                rendered += 1
    assert rendered > 100
