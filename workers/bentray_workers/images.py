"""Pictures of reconstructions as PNG: one slice, a report, a comparison of several with the truth."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bentray_kernels.acquisition import Truth
from bentray_kernels.errors import InvalidInput
from bentray_kernels.tomography import Reconstruction, mean_absolute_error, rmse

from .figures import (
    Limits,
    draw_history,
    draw_map,
    draw_profiles,
    drawing,
    new_figure,
    robust_limits,
    to_png,
)
from .reconstruction_file import read_reconstruction
from .truth_on_grid import object_in, truth_on_grid

Floats = NDArray[np.float64]

LABELS = {
    "speed": "sound speed (m/s)",
    "coverage": "ray length per node (m)",
    "attenuation": "attenuation (Np/m)",
}
NAMES = {"speed": "Sound speed", "coverage": "Coverage", "attenuation": "Attenuation"}
COLORMAPS = ("viridis", "magma", "inferno", "plasma", "cividis", "gray", "bone", "turbo", "coolwarm")
DIFFERENCE = "RdBu_r"
PANEL_IN = (4.3, 3.6)


def slice_png(
    path: Path,
    *,
    quantity: str = "speed",
    index: int | None = None,
    low: float | None = None,
    high: float | None = None,
    colormap: str = "viridis",
) -> bytes:
    """One slice of a reconstruction file.

    Args:
        path: of ``reconstruction.h5``.
        quantity: ``speed``, ``coverage``, or ``attenuation`` where the file has it.
        index: axial index; None: the middle one.
        low, high: values of the first and the last colour, in the quantity's unit; None: from the nodes
            that rays have passed, but for a few outliers.
        colormap: one of ``COLORMAPS``.

    Raises:
        InvalidInput: naming the argument, or the field of the file.
    """
    if colormap not in COLORMAPS:
        raise InvalidInput("colormap", repr(colormap), "one of " + ", ".join(COLORMAPS))
    if quantity not in LABELS:
        raise InvalidInput("quantity", repr(quantity), "one of " + ", ".join(LABELS))
    result = read_reconstruction(path)
    volume = getattr(result, quantity)
    if volume is None:
        raise InvalidInput("quantity", repr(quantity), "one of speed, coverage: this file has no other")
    k = _slice_index(result, index)
    image = _slice(volume, k)
    passed = _slice(result.coverage, k) > 0.0
    limits = robust_limits([image], passed if passed.any() else None)
    if quantity == "coverage":
        limits = (0.0, limits[1])
    limits = _given(limits, low, high)
    with drawing():
        figure = new_figure(6.6, 5.6)
        axes = figure.subplots()
        draw_map(
            axes,
            image,
            result.spacing_m,
            result.origin_m,
            limits,
            colormap=colormap,
            title=f"{NAMES[quantity]}{_which(result, k)}",
            label=LABELS[quantity],
        )
        figure.supxlabel(_facts(result), fontsize=8, color="#666666")
        return to_png(figure)


def report_png(result: Reconstruction, truth: Truth | None = None) -> bytes:
    """Speed, coverage and convergence; with a truth also this, the difference and a profile.

    Several slices are shown by the middle one. A truth whose axes are not known (it needs registration)
    is shown as it is, without a difference.
    """
    k = _slice_index(result, None)
    speed, coverage = _slice(result.speed, k), _slice(result.coverage, k)
    true_speed = truth_on_grid(truth, result, k)
    passed = coverage > 0.0
    limits = robust_limits([speed], passed if passed.any() else None)
    rows, columns = (1, 3) if truth is None else (2, 3) if true_speed is not None else (2, 2)
    with drawing():
        figure = new_figure(PANEL_IN[0] * columns, PANEL_IN[1] * rows + 0.8)
        panels = iter(figure.subplots(rows, columns).ravel())
        grid = (result.spacing_m, result.origin_m)
        if true_speed is not None:
            region = object_in(true_speed, result.water_speed_mps)
            limits = robust_limits([speed, true_speed], region)
        draw_map(
            next(panels),
            speed,
            *grid,
            limits,
            colormap="viridis",
            title="Reconstruction",
            label=LABELS["speed"],
        )
        if true_speed is not None:
            draw_map(
                next(panels),
                true_speed,
                *grid,
                limits,
                colormap="viridis",
                title="Truth",
                label=LABELS["speed"],
            )
            difference = speed - true_speed
            draw_map(
                next(panels),
                difference,
                *grid,
                _symmetric([difference], region),
                colormap=DIFFERENCE,
                title="Difference: " + _errors(speed, true_speed, region),
                label="reconstruction minus truth (m/s)",
            )
        elif truth is not None:
            shown = (
                truth.sound_speed_mps if truth.sound_speed_mps.ndim == 2 else truth.sound_speed_mps[..., k]
            )
            draw_map(
                next(panels),
                shown,
                truth.spacing_m,
                truth.origin_m,
                robust_limits([shown]),
                colormap="viridis",
                title="Truth, not registered to the ring",
                label=LABELS["speed"],
            )
        draw_map(
            next(panels),
            coverage,
            *grid,
            (0.0, robust_limits([coverage])[1]),
            colormap="magma",
            title="Coverage",
            label=LABELS["coverage"],
        )
        draw_history(next(panels), {"residual": result.history})
        if true_speed is not None:
            row = speed.shape[1] // 2
            x = result.origin_m[0] + result.spacing_m[0] * np.arange(speed.shape[0], dtype=np.float64)
            y_mm = 1e3 * (result.origin_m[1] + result.spacing_m[1] * row)
            draw_profiles(
                next(panels),
                x,
                {"truth": true_speed[:, row], "reconstruction": speed[:, row]},
                f"Along y = {y_mm:.1f} mm",
            )
        figure.suptitle(f"Sound speed{_which(result, k)}")
        figure.supxlabel(_facts(result), fontsize=8, color="#666666")
        return to_png(figure)


def comparison_png(truth: Truth, results: Mapping[str, Reconstruction]) -> bytes:
    """The phantom beside each reconstruction, their differences on one scale, and the convergence of all.

    Args:
        truth: on axes x, y[, z].
        results: by the name to show, at least one; several slices are shown by the middle one.

    Raises:
        InvalidInput: for no result, or a truth that cannot be laid on the results' grid.
    """
    if not results:
        raise InvalidInput("results", "none", "at least one reconstruction")
    found = {}
    for name, result in results.items():
        k = _slice_index(result, None)
        true_speed = truth_on_grid(truth, result, k)
        if true_speed is None:
            raise InvalidInput("truth@axes", repr(truth.axes), f"axes x,y[,z] as in the result {name!r}")
        found[name] = (
            result,
            _slice(result.speed, k),
            true_speed,
            object_in(true_speed, result.water_speed_mps),
        )
    limits = robust_limits([true_speed[region] for _, _, true_speed, region in found.values()])
    spread = _symmetric([(speed - true_speed)[region] for _, speed, true_speed, region in found.values()])
    with drawing():
        columns = 1 + len(found)
        figure = new_figure(PANEL_IN[0] * columns, 2.0 * PANEL_IN[1] + 0.6)
        top, bottom = figure.subplots(2, columns)
        first, _, true_speed, _ = next(iter(found.values()))
        draw_map(
            top[0],
            true_speed,
            first.spacing_m,
            first.origin_m,
            limits,
            colormap="viridis",
            title="Phantom",
            label=LABELS["speed"],
        )
        draw_history(bottom[0], {name: result.history for name, result in results.items()})
        for upper, lower, (name, (result, speed, true_speed, region)) in zip(
            top[1:], bottom[1:], found.items(), strict=True
        ):
            grid = (result.spacing_m, result.origin_m)
            draw_map(
                upper,
                speed,
                *grid,
                limits,
                colormap="viridis",
                title=f"{name.capitalize()}: {_errors(speed, true_speed, region)}",
                label=LABELS["speed"],
            )
            draw_map(
                lower,
                speed - true_speed,
                *grid,
                spread,
                colormap=DIFFERENCE,
                title=f"{name.capitalize()} minus phantom",
                label="difference (m/s)",
            )
        figure.suptitle(f"Rays through a phantom in water of {first.water_speed_mps:.0f} m/s")
        return to_png(figure)


def _slice_index(result: Reconstruction, index: int | None) -> int:
    slices = 1 if result.speed.ndim == 2 else result.speed.shape[2]
    if index is None:
        return slices // 2
    if not 0 <= index < slices:
        raise InvalidInput("index", index, f"0 to {slices - 1}")
    return index


def _slice(volume: Floats, index: int) -> Floats:
    return volume if volume.ndim == 2 else volume[..., index]


def _given(limits: Limits, low: float | None, high: float | None) -> Limits:
    for name, value in (("low", low), ("high", high)):
        if value is not None and not math.isfinite(value):
            raise InvalidInput(name, value, "a finite number")
    chosen = (limits[0] if low is None else low, limits[1] if high is None else high)
    if not chosen[0] < chosen[1]:
        if low is None:
            raise InvalidInput("high", high, f"a number above {chosen[0]:.6g}, or a low below it")
        raise InvalidInput("low", low, f"a number below {chosen[1]:.6g}")
    return chosen


def _symmetric(images: list[Floats], region: NDArray[np.bool_] | None = None) -> Limits:
    low, high = robust_limits(images, region)
    reach = max(abs(low), abs(high))
    return -reach, reach


def _errors(speed: Floats, true_speed: Floats, region: NDArray[np.bool_]) -> str:
    span = float(np.ptp(true_speed[region]))
    off = f"{rmse(speed, true_speed, region):.1f} m/s rms"
    if span <= 0.0:
        return off
    return f"{100.0 * mean_absolute_error(speed, true_speed, region, span):.1f} % mean error, {off}"


def _which(result: Reconstruction, index: int) -> str:
    if result.speed.ndim == 2:
        return ""
    text = f", slice index {index} (0 to {result.speed.shape[2] - 1})"
    if math.isfinite(result.spacing_m[2]):
        text += f", z = {1e3 * (result.origin_m[2] + index * result.spacing_m[2]):.1f} mm"
    return text


def _facts(result: Reconstruction) -> str:
    settings = result.settings
    rays = "straight rays" if settings.rays == "straight" else f"curved rays ({settings.eikonal})"
    size = " by ".join(str(n) for n in result.speed.shape)
    facts = [
        rays,
        f"{size} nodes of {1e3 * result.spacing_m[0]:.2g} mm",
        f"water {result.water_speed_mps:.1f} m/s",
    ]
    if result.history:
        last = max(s.sweep for s in result.history)
        rms = math.sqrt(np.mean([s.residual_rms_s**2 for s in result.history if s.sweep == last]))
        facts.insert(1, f"{last} sweep{'s' if last != 1 else ''}")
        facts.append(f"residual {1e9 * rms:.0f} ns")
    return "  ·  ".join(facts)
