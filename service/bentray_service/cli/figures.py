"""The figures of a reconstruction: what `reconstruction.json` holds and the closing tables show."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bentray_kernels.acquisition.dataset import Dataset, Truth
from bentray_kernels.tomography import Reconstruction, mean_absolute_error, rmse
from bentray_workers.truth_on_grid import WATER_TOLERANCE_MPS, object_in, truth_on_grid


def figures(result: Reconstruction, dataset: Dataset, seconds: float) -> dict[str, Any]:
    """Plain values for JSON, SI units, the unit in the name.

    Args:
        result: what was reconstructed.
        dataset: what it was reconstructed from; its truth, if any, gives the errors.
        seconds: wall-clock time of the reconstruction, s.

    Returns:
        Settings, residual history, speed range, time and provenance; ``truth`` is None without a truth.
    """
    last = [sweep for sweep in result.history if sweep.sweep == max(s.sweep for s in result.history)]
    return {
        "seconds": round(seconds, 3),
        "slices": dataset.slices,
        "shape": list(result.speed.shape),
        "spacing_m": list(result.spacing_m),
        "origin_m": list(result.origin_m),
        "water_speed_mps": result.water_speed_mps,
        "speed_range_mps": [float(result.speed.min()), float(result.speed.max())],
        "residual_rms_s": float(np.sqrt(np.mean([s.residual_rms_s**2 for s in last]))) if last else None,
        "history": [
            {"slice": s.slice, "sweep": s.sweep, "residual_rms_s": s.residual_rms_s, "emitters": s.emitters}
            for s in result.history
        ],
        "truth": None if dataset.truth is None else errors(result, dataset.truth, dataset.roi),
        "settings": result.settings.to_dict(),
        "provenance": dict(result.provenance),
    }


def errors(result: Reconstruction, truth: Truth, roi: NDArray[np.bool_] | None = None) -> dict[str, Any]:
    """How far the image is from the truth, at the image's own nodes, and in which region that was read.

    The truth is laid on the nodes by linear interpolation, without any registration. The region is
    ``roi`` where it is on the truth's grid; else the outline of what is not water; else every node that
    the truth covers. ``region`` says which of these it was, or why nothing could be compared.
    """
    true_speed = _on_grid(truth, result)
    if true_speed is None:
        return _not_compared(f"the truth, on axes {truth.axes!r}, must be registered with the image first")
    covered = np.isfinite(true_speed)
    if not covered.any():
        return _not_compared("no node of the image lies within the truth")
    marked = None
    if roi is not None and roi.shape == truth.sound_speed_mps.shape:
        # As values 1 and 2, for a truth must be above 0.
        marked = _on_grid(replace(truth, sound_speed_mps=1.0 + roi.astype(np.float64)), result)
    water = np.abs(np.where(covered, true_speed, result.water_speed_mps) - result.water_speed_mps)
    if marked is not None and (marked > 1.5).any():
        choice, region = "mask/roi of the file", covered & (marked > 1.5)
    elif (water > WATER_TOLERANCE_MPS).any():
        choice = "the outline of what is not water in the truth"
        slices = np.atleast_3d(true_speed)
        outline = [object_in(slices[..., k], result.water_speed_mps) for k in range(slices.shape[2])]
        region = np.stack(outline, axis=-1).reshape(true_speed.shape)
    else:
        choice, region = "every node that the truth covers", covered
    low, high = float(true_speed[region].min()), float(true_speed[region].max())
    return {
        "region": choice,
        "region_nodes": int(region.sum()),
        "true_range_mps": [low, high],
        "mean_absolute_error_of_range": (
            mean_absolute_error(result.speed, true_speed, region, high - low) if high > low else None
        ),
        "rmse_mps": rmse(result.speed, true_speed, region),
        "registration": "none",
    }


def _on_grid(truth: Truth, result: Reconstruction) -> NDArray[np.float64] | None:
    """The truth at the nodes of the image, in the image's shape; None where the axes do not tell how."""
    count = 1 if result.speed.ndim == 2 else result.speed.shape[2]
    slices = [found for k in range(count) if (found := truth_on_grid(truth, result, k)) is not None]
    return np.stack(slices, axis=-1).reshape(result.speed.shape) if len(slices) == count else None


def _not_compared(why: str) -> dict[str, Any]:
    return {"region": f"not compared: {why}", "region_nodes": 0}


def summary(found: dict[str, Any]) -> list[tuple[str, str]]:
    """Rows (name, value) of the closing table, from what ``figures`` gave."""
    low, high = found["speed_range_mps"]
    rows = [
        ("rays", found["settings"]["rays"]),
        ("image", " by ".join(map(str, found["shape"])) + f" nodes of {found['spacing_m'][0] * 1e3:.3g} mm"),
        ("speed", f"{low:.0f} to {high:.0f} m/s"),
        ("time", f"{found['seconds']:.1f} s"),
    ]
    if found["residual_rms_s"] is not None:
        rows.insert(3, ("residual, last sweep", f"{found['residual_rms_s'] * 1e9:.0f} ns rms"))
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
