"""Metrics of a reconstruction, for `reconstruction.json` and the summary table."""

import math
from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bentray_kernels.acquisition.dataset import Dataset, Truth
from bentray_kernels.acquisition.quality.finding import NOTHING_FOUND
from bentray_kernels.tomography import Reconstruction
from bentray_kernels.tomography.comparison import NotComparable, compare
from bentray_kernels.tomography.model_selection.selection import advice_of, choice_table, criterion
from bentray_kernels.tomography.result import residual_within

# Percentages for the quantiles of the residuals.
SHARES = (50, 90, 99)


def figures(result: Reconstruction, dataset: Dataset, seconds: float) -> dict[str, Any]:
    """The metrics of a reconstruction as plain values in SI units.

    Args:
        result: the reconstruction.
        dataset: its input; errors are computed from its ground truth, if any.
        seconds: wall-clock time of the reconstruction, s.

    Returns:
        ``trust``: how far to trust the image, in one line;
        settings, residual history, speed range, time and provenance; ``residual_within_s``: quantiles of the
        absolute residuals of the last iteration by percentage; ``recovery_mean``: mean of the resolution
        check inside the array; ``uncertainty_rms_mps``: root mean square of the standard deviations inside
        the array; ``resolution_width_m``: of each slice, or one; ``doubt``: why the image is doubtful, and
        ``cautions``: all that the reader must know, with codes; ``trials`` and ``reason``: candidate models
        and choice of ``auto``; ``candidates``: rows of their table, with the ``criterion``. Missing values
        are None, missing doubts, cautions, widths, trials and reasons are empty.
    """
    return {
        "trust": result.trust,
        "doubt": result.doubt,
        "cautions": [asdict(caution) for caution in result.cautions],
        "seconds": round(seconds, 3),
        "slices": dataset.slices,
        "shape": list(result.speed.shape),
        "spacing_m": list(result.spacing_m),
        "origin_m": list(result.origin_m),
        "water_speed_mps": result.water_speed_mps,
        "speed_range_mps": [float(result.speed.min()), float(result.speed.max())],
        "residual_rms_s": result.residual_rms_s,
        "residual_within_s": (
            None
            if result.residuals is None
            else {str(share): residual_within(result.residuals, share / 100.0) for share in SHARES}
        ),
        "history": [asdict(sweep) for sweep in result.history],
        "recovery_mean": _recovery_mean(result),
        "uncertainty_rms_mps": result.uncertainty_rms_mps,
        "resolution_width_m": list(result.resolution_width_m),
        "reason": advice_of(result),
        "candidates": choice_table(result),
        "criterion": criterion(result.trials),
        "trials": [asdict(trial) for trial in result.trials],
        "truth": None if dataset.truth is None else errors(result, dataset.truth, dataset.roi),
        "settings": result.settings.to_dict(),
        "provenance": dict(result.provenance),
    }


def errors(result: Reconstruction, truth: Truth, roi: NDArray[np.bool_] | None = None) -> dict[str, Any]:
    """Errors against the ground truth, or the reason why they were not computed, as plain values."""
    try:
        comparison = compare(result, truth, roi)
    except NotComparable as reason:
        return {"region": f"not compared: {reason}", "region_nodes": 0, "axes": truth.axes}
    return {
        "region": comparison.region_choice,
        "region_nodes": int(comparison.region.sum()),
        "true_range_mps": list(comparison.range),
        "mean_absolute_error_of_range": comparison.mean_absolute_of_range,
        "mean_absolute_error_mps": comparison.mean_absolute,
        "rmse_mps": comparison.rms,
        "ssim": comparison.ssim,
        "correlation": comparison.correlation,
        "statistics": dict(zip(("image", "truth"), map(asdict, comparison.statistics()), strict=True)),
        "registration": "none",
        "axes": truth.axes,
    }


def _recovery_mean(result: Reconstruction) -> float | None:
    if result.recovery is None:
        return None
    # Exactly 0 outside the reconstructed region.
    inside = result.recovery != 0.0
    return float(result.recovery[inside].mean()) if inside.any() else 0.0


def summary(facts: dict[str, Any]) -> list[tuple[str, str]]:
    """Rows (name, value) of the summary table, from the result of ``figures``."""
    low, high = facts["speed_range_mps"]
    rows = [
        ("trust", facts["trust"]),
        ("rays", "straight" if facts["settings"]["rays"] == "straight" else "bent"),
        ("method", facts["settings"]["method"]),
        ("image", " by ".join(map(str, facts["shape"])) + f" nodes of {facts['spacing_m'][0] * 1e3:.3g} mm"),
        ("speed", f"{low:.0f} to {high:.0f} m/s, in water of {facts['water_speed_mps']:.1f} m/s"),
        ("time", f"{facts['seconds']:.1f} s"),
    ]
    if facts["residual_rms_s"] is not None:
        rows.insert(5, ("residual", f"{facts['residual_rms_s'] * 1e9:.0f} ns rms"))
    if facts["recovery_mean"] is not None:
        rows.append(("resolution check", f"{100 * facts['recovery_mean']:.0f} % of a checkerboard recovered"))
    if "pulse" in facts["provenance"]:
        rows.append(("pulse", facts["provenance"]["pulse"]))
    if facts["provenance"].get("quality", NOTHING_FOUND) != NOTHING_FOUND:
        rows.append(("scan", facts["provenance"]["quality"]))
    truth = facts["truth"]
    if truth is not None:
        if truth.get("mean_absolute_error_of_range") is not None:
            rows.append(
                ("mean absolute error", f"{100 * truth['mean_absolute_error_of_range']:.1f} % of the range")
            )
        if "rmse_mps" in truth:
            rows.append(("rms error", f"{truth['rmse_mps']:.1f} m/s"))
            similarities = {"SSIM": truth["ssim"], "correlation": truth["correlation"]}
            finite = [f"{name} {value:.3f}" for name, value in similarities.items() if math.isfinite(value)]
            if finite:
                rows.append(("similarity", ", ".join(finite)))
        rows.append(("error region", truth["region"]))
    return rows
