"""The figures of a reconstruction: what `reconstruction.json` holds and the closing tables show."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import RegularGridInterpolator

from bentray_kernels.acquisition.dataset import Dataset, Truth
from bentray_kernels.tomography import Reconstruction, mean_absolute_error, rmse

# A truth within this of the water speed is taken for water when no region is given, m/s.
WATER_TOLERANCE_MPS = 1.0


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

    The truth is read at the nodes by linear interpolation, without any registration. The region is
    ``roi`` where it is on the truth's grid; else where the truth is not water; else every node that the
    truth covers. ``region`` says which of these it was, or why nothing could be compared.
    """
    if truth.sound_speed_mps.ndim != result.speed.ndim or not np.isfinite(result.spacing_m).all():
        return {
            "region": "not compared: truth and image differ in their axes",
            "region_nodes": 0,
        }
    points = np.stack(
        np.meshgrid(
            *(
                start + step * np.arange(count)
                for start, step, count in zip(
                    result.origin_m, result.spacing_m, result.speed.shape, strict=True
                )
            ),
            indexing="ij",
        ),
        axis=-1,
    )
    true_speed = _read(truth, truth.sound_speed_mps, points)
    covered = np.isfinite(true_speed)
    if roi is not None and roi.shape == truth.sound_speed_mps.shape:
        choice = "mask/roi of the file"
        region = covered & (_read(truth, roi.astype(np.float64), points) > 0.5)
    else:
        choice = f"where the true speed is more than {WATER_TOLERANCE_MPS:g} m/s off the water's"
        region = covered & (np.abs(true_speed - result.water_speed_mps) > WATER_TOLERANCE_MPS)
    if not region.any():
        choice, region = "every node that the truth covers", covered
    if not region.any():
        return {"region": "not compared: no node of the image lies within the truth", "region_nodes": 0}
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


def _read(truth: Truth, values: NDArray[np.float64], points: NDArray[np.float64]) -> NDArray[np.float64]:
    # NaN outside the truth's grid, so that such nodes drop out of the region.
    axes = [
        start + step * np.arange(count)
        for start, step, count in zip(truth.origin_m, truth.spacing_m, values.shape, strict=True)
    ]
    return np.asarray(RegularGridInterpolator(axes, values, bounds_error=False, fill_value=np.nan)(points))


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
