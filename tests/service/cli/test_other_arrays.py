"""`bentray reconstruct` and `quality` of an arc: limited angle and opening angle are stated first."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bentray_kernels.acquisition import Dataset
from bentray_workers.files.dataset import write_dataset

from .conftest import Run

QUICK = ("--nodes", 32, "--iterations", 2, "--method", "gauss-newton", "--no-attenuation")


@pytest.fixture(scope="module")
def arc(scan: Dataset) -> Dataset:
    """The elements of two thirds of the turn, with directions towards the middle."""
    kept = np.arange(16)
    assert scan.delta_tof_s is not None
    return replace(
        scan,
        element_position_m=scan.element_position_m[kept],
        element_normal=-scan.element_position_m[kept],
        tx=kept,
        rx=kept,
        delta_tof_s=scan.delta_tof_s[np.ix_(kept, kept)],
        log_ratio_np=None,
        array_type="free",
    )


def test_an_arc_has_an_image_and_a_sentence(bentray: Run, arc: Dataset, tmp_path: Path) -> None:
    write_dataset(tmp_path / "arc.h5", arc)
    shown = bentray(
        "reconstruct", tmp_path / "arc.h5", "-o", tmp_path / "out", *QUICK, "--opening-angle", 120
    )
    first = shown.stdout.splitlines()[0]
    # Neighbours, up to the third, are beyond 60° from the middle of the cone.
    assert "pairs (35 %) are outside the opening angle of 120° and left out. Limited angle:" in first
    assert "edges parallel to the missing directions" in first
    record = json.loads((tmp_path / "out" / "reconstruction.json").read_text())
    assert record["provenance"]["geometry"] == first
    assert record["settings"]["opening_angle_deg"] == 120.0
    report = json.loads(bentray("quality", tmp_path / "arc.h5", "-o", tmp_path / "report", "--json").stdout)
    assert (
        "elements cover 240° of 360°"
        in {f["check"]: f["found"] for f in report["findings"]}["angular coverage"]
    )
    assert "angular coverage" in report["checked"]


@pytest.mark.parametrize(
    ("change", "options", "words"),
    [
        ({"element_normal": None}, ("--opening-angle", 90), "geometry/element_normal"),
        ({"element_position_m": np.outer(np.arange(16.0), (0.004, 0.002))}, (), "all elements on one line"),
    ],
)
def test_what_has_no_image_is_refused_at_once(
    bentray: Run,
    arc: Dataset,
    tmp_path: Path,
    change: dict[str, object],
    options: tuple[object, ...],
    words: str,
) -> None:
    # Plausible times: those of water.
    write_dataset(
        tmp_path / "arc.h5", replace(arc, delta_tof_s=np.zeros((16, 16)), truth=None, roi=None, **change)
    )
    refused = bentray("reconstruct", tmp_path / "arc.h5", "-o", tmp_path / "out", *QUICK, *options, code=2)
    assert words in refused.stderr
