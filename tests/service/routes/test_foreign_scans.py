"""POST /v1/datasets with scans of other programs: taken by content, refused with the field at fault."""

from __future__ import annotations

import io

import numpy as np
import pytest
from scipy.io import savemat

from ...workers.foreign_scans.scans import delta_tof, travel_times, waveforms, write_matlab73

BINARY = {"Content-Type": "application/octet-stream"}


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
    answer = start().post("/v1/datasets", content=content, headers=BINARY)
    assert answer.status_code == 201, answer.text
    body = answer.json()
    assert (body["elements"], body["ntx"], body["nrx"]) == (8, 8, 8)
    assert (body["has_traces"], body["has_travel_times"]) == (kind == "traces", kind != "traces")


def test_the_field_at_fault_is_named(start):
    answer = start().post("/v1/datasets", content=matlab({"delta_tof": delta_tof()}), headers=BINARY)
    assert answer.status_code == 422
    assert answer.headers["content-type"] == "application/problem+json"
    assert answer.json()["field"] == "element_positions"
    assert answer.json()["found"] == "nothing"
