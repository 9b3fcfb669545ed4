"""Findings as a file: round trip, bit for bit of every pair."""

import json
import math
from dataclasses import fields

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from bentray_kernels.acquisition.quality import Finding
from bentray_workers.files.picking_files import ScanFindings, read_findings, write_findings

findings = st.builds(
    Finding,
    check=st.text(max_size=8),
    found=st.text(max_size=8),
    accepted=st.text(max_size=8),
    action=st.sampled_from(["left out", "corrected", "refused", "reported"]),
    elements=st.lists(st.integers(0, 4096), max_size=3).map(tuple),
    role=st.sampled_from(["emission", "reception", ""]),
    pairs=st.none() | arrays(bool, array_shapes(min_dims=2, max_dims=2)),
    value=st.floats(allow_infinity=False),
    unit=st.text(max_size=4),
    slice=st.integers(0, 50),
)


@given(found=st.builds(ScanFindings, st.lists(findings, max_size=3).map(tuple), st.booleans(), st.booleans()))
def test_a_round_trip_changes_nothing(found, tmp_path_factory):
    path = tmp_path_factory.getbasetemp() / "findings.json"
    write_findings(path, found)
    again = read_findings(path)
    assert again[1:] == found[1:]
    assert len(again.findings) == len(found.findings)
    for finding, other in zip(again.findings, found.findings, strict=True):
        for name in (field.name for field in fields(Finding)):
            np.testing.assert_equal(getattr(finding, name), getattr(other, name))


@pytest.mark.parametrize("content", ["", "{}", '{"findings": [{}], "examined": true, "changed": true}'])
def test_damaged_file_is_reported(tmp_path, content):
    (tmp_path / "findings.json").write_text(content)
    with pytest.raises((ValueError, KeyError)):
        read_findings(tmp_path / "findings.json")


def test_a_million_pairs_take_a_bit_each(tmp_path):
    wrong = Finding("dead elements", "1", "", "left out", pairs=np.ones((1000, 1000), bool), value=math.nan)
    write_findings(tmp_path / "findings.json", ScanFindings((wrong,), True, True))
    assert (tmp_path / "findings.json").stat().st_size < 200_000
    assert json.loads((tmp_path / "findings.json").read_text())["content"]["findings"][0]["value"] is None


@pytest.mark.parametrize("spoiled", ["findings.json", "picked.h5"])
@pytest.mark.parametrize("how", ["flip", "cut", "empty", "missing"])
def test_damage_of_either_file_is_found(tmp_path, spoiled, how):
    path, picked = tmp_path / "findings.json", tmp_path / "picked.h5"
    picked.write_bytes(bytes(range(256)))
    result = ScanFindings((), True, True)
    write_findings(path, result, picked)
    assert read_findings(path, picked) == result
    file = tmp_path / spoiled
    content = file.read_bytes()
    if how == "missing":
        file.unlink()
    else:
        # In the digest of the second file, or in its middle.
        flipped = content[:-9] + bytes([content[-9] ^ 1]) + content[-8:]
        file.write_bytes({"flip": flipped, "cut": content[:40], "empty": b""}[how])
    with pytest.raises((OSError, ValueError, KeyError, TypeError)):
        read_findings(path, picked)
