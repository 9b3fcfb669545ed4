"""The figures of a reconstruction: what `reconstruction.json` holds and the closing tables show."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from bentray_kernels.acquisition.dataset import Dataset, Truth
from bentray_kernels.tomography import Reconstruction
from bentray_workers.comparison import NotComparable, compare


def figures(result: Reconstruction, dataset: Dataset, seconds: float) -> dict[str, Any]:
    """Plain values for JSON, SI units, the unit in the name.

    Args:
        result: what was reconstructed.
        dataset: what it was reconstructed from; its truth, if any, gives the errors.
        seconds: wall-clock time of the reconstruction, s.

    Returns:
        Settings, residual history, speed range, time and provenance; ``truth`` is None without a truth.
    """
    return {
        "seconds": round(seconds, 3),
        "slices": dataset.slices,
        "shape": list(result.speed.shape),
        "spacing_m": list(result.spacing_m),
        "origin_m": list(result.origin_m),
        "water_speed_mps": result.water_speed_mps,
        "speed_range_mps": [float(result.speed.min()), float(result.speed.max())],
        "residual_rms_s": result.residual_rms_s,
        "history": [
            {"slice": s.slice, "sweep": s.sweep, "residual_rms_s": s.residual_rms_s, "emitters": s.emitters}
            for s in result.history
        ],
        "truth": None if dataset.truth is None else errors(result, dataset.truth, dataset.roi),
        "settings": result.settings.to_dict(),
        "provenance": dict(result.provenance),
    }


def errors(result: Reconstruction, truth: Truth, roi: NDArray[np.bool_] | None = None) -> dict[str, Any]:
    """What ``bentray_workers.comparison.compare`` found, or why nothing was compared, as plain values."""
    try:
        found = compare(result, truth, roi)
    except NotComparable as reason:
        return {"region": f"not compared: {reason}", "region_nodes": 0, "axes": truth.axes}
    return {
        "region": found.region_choice,
        "region_nodes": int(found.region.sum()),
        "true_range_mps": list(found.true_range_mps),
        "mean_absolute_error_of_range": found.mean_absolute_error_of_range,
        "rmse_mps": found.rmse_mps,
        "registration": "none",
        "axes": truth.axes,
    }


def summary(found: dict[str, Any]) -> list[tuple[str, str]]:
    """Rows (name, value) of the closing table, from what ``figures`` gave."""
    low, high = found["speed_range_mps"]
    rows = [
        ("rays", found["settings"]["rays"]),
        ("method", found["settings"]["method"]),
        ("image", " by ".join(map(str, found["shape"])) + f" nodes of {found['spacing_m'][0] * 1e3:.3g} mm"),
        ("speed", f"{low:.0f} to {high:.0f} m/s"),
        ("time", f"{found['seconds']:.1f} s"),
    ]
    if found["residual_rms_s"] is not None:
        rows.insert(4, ("residual", f"{found['residual_rms_s'] * 1e9:.0f} ns rms"))
    truth = found["truth"]
    if truth is not None:
        if truth.get("mean_absolute_error_of_range") is not None:
            rows.append(
                ("mean absolute error", f"{100 * truth['mean_absolute_error_of_range']:.1f} % of the range")
            )
        if "rmse_mps" in truth:
            rows.append(("rms error", f"{truth['rmse_mps']:.1f} m/s"))
        rows.append(("errors read", truth["region"]))
    return rows
