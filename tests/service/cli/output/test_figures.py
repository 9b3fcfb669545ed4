"""The figures of a result: plain values, and the same errors as in the pictures."""

import json
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from bentray_kernels.acquisition import Dataset, Truth
from bentray_kernels.acquisition.quality.finding import words
from bentray_kernels.tomography import Candidate, Caution, Iteration, Settings
from bentray_kernels.tomography.result import residual_counts
from bentray_kernels.tomography.stored_settings import from_stored
from bentray_service.cli.output.figures import errors, figures, summary
from bentray_workers.images.comparison import comparison_png
from bentray_workers.images.report import report_png

from ....kernels.tomography.comparison.squares import WATER, disc, image, truth


def test_the_errors_are_those_of_compare_as_plain_values() -> None:
    result = errors(image(disc() + 10.0), truth(disc()))
    statistics = result.pop("statistics")
    assert statistics["image"]["mean"] == pytest.approx(statistics["truth"]["mean"] + 10.0)
    assert statistics["image"]["size"] == pytest.approx(81e-6)
    assert json.loads(json.dumps(result)) == {
        "region": "the outline of what is not water in the truth",
        "region_nodes": 81,
        "true_range_mps": [1450.0, 1550.0],
        "mean_absolute_error_of_range": pytest.approx(0.1),
        "mean_absolute_error_mps": pytest.approx(10.0),
        "rmse_mps": pytest.approx(10.0),
        "ssim": pytest.approx(1.0, abs=1e-4),
        "correlation": pytest.approx(1.0),
        "registration": "none",
        "axes": "x,y",
    }


def test_incomparable_results_are_reported() -> None:
    assert errors(image(disc()), replace(truth(disc()), axes="as displayed")) == {
        "region": "not compared: the truth must be registered with the image first",
        "region_nodes": 0,
        "axes": "as displayed",
    }


@pytest.mark.parametrize("wide", [False, True])
def test_table_and_pictures_show_the_same_errors(undrawn: Any, wide: bool) -> None:
    """Fat as fast as the water lies in the region of the file and outside the outline."""
    roi = np.zeros((17, 17), dtype=bool)
    roi[2:15, 2:15] = True
    speed = disc() + 7.0
    speed[2:4] += 30.0
    scan = replace(dataset(truth(disc())), roi=roi if wide else None)
    rows = dict(summary(figures(image(speed), scan, 1.0)))
    shown = f"{rows['mean absolute error'].removesuffix(' the range')} range, {rows['rms error']} rms"
    assert scan.truth is not None
    comparison_png(scan.truth, {"bent": image(speed)}, scan.roi)
    assert f"Bent\n{shown}" in undrawn.words()
    assert f"Errors in: {rows['error region']}" in undrawn.words()
    report_png(image(speed), scan.truth, scan.roi)
    assert f"Difference: {shown}" in undrawn.words()
    assert rows["error region"].startswith("mask/roi" if wide else "the outline")


def dataset(truth_of: Truth | None) -> Dataset:
    ring = np.array([[0.0, 0.0], [0.016, 0.0], [0.0, 0.016]])
    everyone = np.arange(3)
    return Dataset(ring, everyone, everyone, WATER, delta_tof_s=np.zeros((3, 3)), truth=truth_of)


def test_the_residual_is_that_of_the_last_sweep_over_all_slices() -> None:
    history = (
        Iteration(0, 1, 9e-7, 3),
        Iteration(1, 1, 9e-7, 3),
        Iteration(0, 2, 3e-7, 3),
        Iteration(1, 2, 4e-7, 3),
    )
    result = figures(replace(image(disc()), history=history), dataset(None), 1.25)
    assert result["residual_rms_s"] == pytest.approx(math.sqrt((9 + 16) / 2) * 1e-7)
    assert len(result["history"]) == 4
    last = {"slice": 1, "sweep": 2, "residual_rms_s": 4e-7, "emitters": 3, "stage": 0, "given": True}
    assert result["history"][3] == last | {
        "band_hz": None,
        "misfit": None,
        "held_out_misfit": None,
        "of_attenuation": False,
    }
    assert result["truth"] is None
    assert result["seconds"] == 1.25
    assert result["speed_range_mps"] == [1450.0, 1550.0]
    assert from_stored(result["settings"]) == Settings(method="sart", nodes=16)


def test_summary_shows_errors_and_region_only_with_a_truth() -> None:
    without = dict(summary(figures(image(disc()), dataset(None), 1.0)))
    assert not {"rms error", "error region", "residual"} & set(without)
    with_truth = dict(summary(figures(image(disc() + 10.0), dataset(truth(disc())), 1.0)))
    assert with_truth["rms error"] == "10.0 m/s"
    assert with_truth["speed"].endswith(" m/s, in water of 1500.0 m/s")
    assert with_truth["mean absolute error"] == "10.0 % of the range"
    assert with_truth["similarity"] == "SSIM 1.000, correlation 1.000"
    assert with_truth["error region"] == "the outline of what is not water in the truth"


def test_missing_values_are_none_or_empty() -> None:
    result = figures(image(disc()), dataset(None), 1.0)
    assert (result["residual_within_s"], result["recovery_mean"]) == (None, None)
    assert (result["reason"], result["trials"]) == ("", [])
    assert "resolution check" not in dict(summary(result))


def test_summary_shows_findings() -> None:
    def row(label: str) -> str | None:
        result = replace(image(disc()), provenance={"quality": label})
        return dict(summary(figures(result, dataset(None), 1.0))).get("scan")

    assert row("dead elements: 1 without a pulse in reception (4), left out").startswith("dead elements: 1")
    assert row(words([])) is None


def test_summary_shows_the_uncertainty_inside_the_array() -> None:
    speed = disc()
    spread = np.where(np.arange(speed.shape[1]) < 5, 6.0, 0.0) * np.ones_like(speed)
    result = replace(image(speed), uncertainty=spread, resolution_width_m=(0.0016, 0.002, 0.0031))
    record = json.loads(json.dumps(figures(result, dataset(None), 1.0)))
    assert record["uncertainty_rms_mps"] == pytest.approx(6.0)
    assert record["resolution_width_m"] == [0.0016, 0.002, 0.0031]
    assert dict(summary(record))["trust"] == "±6 m/s (1 sd), detail down to 4.7 mm, no cautions"
    without = figures(image(speed), dataset(None), 1.0)
    assert dict(summary(without))["trust"] == "no standard deviations, no cautions"
    assert (record["doubt"], record["cautions"]) == ("", [])
    cautious = replace(result, cautions=(Caution("uncertainty", "too small"),))
    listed = figures(cautious, dataset(None), 1.0)
    assert listed["cautions"] == [{"code": "uncertainty", "text": "too small", "doubtful": False}]
    assert listed["doubt"] == ""
    assert listed["trust"].endswith(", 1 caution: deviations may be too small")


def test_summary_shows_residuals_resolution_and_candidates() -> None:
    speed = disc()
    recovery = np.zeros_like(speed)
    recovery[:, :5] = 0.5
    recovery[:, 3] = -0.75
    trials = (Candidate({"rays": "straight"}, 4e-8, 3e-8), Candidate({"rays": "curved"}, 6e-8, 5e-8))
    residuals = residual_counts(np.random.default_rng(0).normal(0.0, 1e-7, 10_000))
    result = replace(image(speed), recovery=recovery, trials=trials, residuals=residuals)
    record = json.loads(json.dumps(figures(result, dataset(None), 1.0)))
    assert record["residual_within_s"] == {
        "50": pytest.approx(0.67e-7, rel=0.1),
        "90": pytest.approx(1.64e-7, rel=0.1),
        "99": pytest.approx(2.58e-7, rel=0.1),
    }
    assert record["recovery_mean"] == pytest.approx(0.25)
    assert dict(summary(record))["resolution check"] == "25 % of a checkerboard recovered"
    assert record["reason"].startswith("auto chose straight rays: bent rays do not")
    assert [row["outcome"] for row in record["candidates"]] == [
        "chosen and shown",
        "refused: predicts what was held out 50 % worse",
    ]
    assert record["criterion"] == "held_out_rms_s"
    assert record["trials"][1] == {
        "settings": {"rays": "curved"},
        "held_out_rms_s": 6e-8,
        "shown_rms_s": 5e-8,
        "held_out_mean_s": None,
    }
