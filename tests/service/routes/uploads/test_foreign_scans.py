"""POST /v1/datasets with scans of other programs: taken by content, refused with the field at fault."""

import base64
import io

import numpy as np
import pytest
from scipy.io import savemat

from bentray_kernels.errors import InvalidInput
from bentray_service.routes.uploads.upload_metadata import read_metadata

from ....workers.foreign_scans.hdf5_scans import openusct_fields, write_fields, zea_fields
from ....workers.foreign_scans.kit_measurement import write_measurement, zipped
from ....workers.foreign_scans.scans import delta_tof, positions, travel_times, waveforms, write_matlab73
from ...conftest import STREAM, created


def matlab(variables: dict[str, np.ndarray]) -> bytes:
    made = io.BytesIO()
    savemat(made, variables, do_compression=True)
    return made.getvalue()


@pytest.mark.parametrize("kind", ["matlab5", "matlab73", "npz", "traces"])
def test_they_are_taken(start, tmp_path, kind):
    if kind == "matlab73":
        write_matlab73(tmp_path / "scan.mat", travel_times())
        content = (tmp_path / "scan.mat").read_bytes()
    elif kind == "npz":
        made = io.BytesIO()
        times = travel_times()
        np.savez(
            made,
            element_position_m=times["element_positions"],
            delta_tof_s=times["delta_tof"],
            tx=np.arange(8),
            rx=np.arange(8),
            temperature_c=22.0,
        )
        content = made.getvalue()
    else:
        content = matlab(waveforms() if kind == "traces" else travel_times())
    body = created(start().post("/v1/datasets", content=content, headers=STREAM))
    assert (body["elements"], body["ntx"], body["nrx"]) == (8, 8, 8)
    assert (body["has_traces"], body["has_travel_times"]) == (kind == "traces", kind != "traces")


@pytest.mark.parametrize("kind", ["zea", "openusct", "kit"])
def test_scans_of_other_projects_are_taken(start, tmp_path, kind):
    if kind == "kit":
        source = zipped(write_measurement(tmp_path / "scan"), tmp_path / "scan.zip")
    else:
        source = write_fields(tmp_path / "scan", zea_fields() if kind == "zea" else openusct_fields())
    body = created(start().post("/v1/datasets", content=source.read_bytes(), headers=STREAM))
    assert (body["ntx"], body["dimension"], body["has_traces"]) == (3, 3 if kind == "kit" else 2, True)


def test_the_field_at_fault_is_named(start):
    answer = start().post("/v1/datasets", content=matlab({"delta_tof": delta_tof()}), headers=STREAM)
    assert answer.status_code == 422
    assert answer.headers["content-type"] == "application/problem+json"
    assert answer.json()["field"] == "element_positions"
    assert answer.json()["found"] == "nothing"


OWN = "map=element_position%3Dpos&map=delta_tof%3Ddtof&unit=mm&unit=us&temperature_c=24&frequency_hz=1e6"


def own_variables() -> bytes:
    return matlab({"pos": 1e3 * positions(), "dtof": 1e6 * delta_tof()})


def test_own_variables_and_units_are_stated_in_the_request(start):
    service = start()
    refused = service.post("/v1/datasets", content=own_variables(), headers=STREAM)
    assert refused.status_code == 422
    assert "pos" in refused.json()["found"]
    taken = created(service.post(f"/v1/datasets?{OWN}", content=own_variables(), headers=STREAM))
    assert taken["water_speed_mps"] == pytest.approx(1494.1, abs=0.5)
    assert "assumed" not in taken["source"]
    for query in ("unit=inch", "map=x%3Dy", "temperature_c=1e9", "temperature_c=x", "map=%00"):
        wrong = service.post(f"/v1/datasets?{query}", content=own_variables(), headers=STREAM)
        assert wrong.status_code == 422, query


def test_they_are_metadata_of_a_resumable_upload():
    def packed(**said: str) -> str:
        return ",".join(f"{name} {base64.b64encode(text.encode()).decode()}" for name, text in said.items())

    said = {"map": "element_position=pos,delta_tof=dtof", "unit": "mm,us", "temperature_c": "24"}
    what, given = read_metadata(packed(kind="dataset", filename="scan.mat", **said))
    assert (what, given["map"], given["unit"]) == (
        "dataset",
        ["element_position=pos", "delta_tof=dtof"],
        ["mm", "us"],
    )
    assert (given["temperature_c"], given["filename"]) == (24.0, "scan.mat")
    assert read_metadata(packed(kind="dataset")) == ("dataset", {})
    for wrong in ({"temperature_c": "warm"}, {"unit": "inch"}, {"map": "pos"}):
        with pytest.raises(InvalidInput):
            read_metadata(packed(**wrong))
