"""Doubts about a finished image: cut off by the speed bounds, or travel times that it does not explain."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from ..acquisition import Dataset
from ..arrays import Floats, Ints
from ..requests.request_fields import declared, unused, value_at
from .directivity import within_opening
from .pairs import reciprocal_differences
from .result import Caution, Iteration, Reconstruction, residual_within
from .settings import Settings
from .stopping import travel_time_noise
from .uncertainty.model_errors import GUIDED

# This part of the residuals is judged, so that a few wrong picks do not decide; of normal ones with standard
# deviation 1 it is within ``NORMAL``.
TYPICAL, NORMAL = 0.9, 1.645

# An image is cut off where this part of the nodes with rays lies within ``NEAR`` of a bound: the radar
# profile and the trunk of the tests have 0.034 and 0.051, good images none. Water on a bound does not count.
CUT_OFF, NEAR = 0.01, 1e-3

# The residual is far above the noise beyond this many times the noise, if it is also this part of what one
# constant speed leaves: after two iterations of SART it is 0.35, of finished images 0.25. Residual and noise
# are too large beyond ``TOO_LARGE`` of the travel times, 30 m/s along a whole path in water. Below ``SMALL``
# of them, 1.5 m/s, errors of picks and grids exceed the noise.
OVER_NOISE, OF_CONSTANT, TOO_LARGE, SMALL = 2.0, 0.5, 0.02, 1e-3

# The image is no better than a constant if it leaves more than this part of its residual. Pairs measured both
# ways contradict each other if they differ by more than this part of it: noise without an object by 1.0,
# emitters in a wrong order by 0.9, at a signal-to-noise ratio of 3 by up to 0.75.
NO_BETTER = 0.9
CONTRADICTS = 0.8

# An image of the attenuation must predict held-out views better than a constant by this factor. Chosen on
# waves of two simulators, 300 and 400 kHz: images better than the best constant had 0.93, others 0.95 to 1.7.
CLEARLY = 0.94

# Decibels of a neper.
DB = 20.0 / math.log(10.0)

# A constant this near to the speed of the water is the water.
WATER = 2e-3

# Iterations after which the residuals are those of a fitted image.
FITTED = 3


def fit_cautions(
    dataset: Dataset, settings: Settings, residuals: Ints, history: Sequence[Iteration]
) -> Iterator[Caution]:
    """Cautions that follow from the residuals of an image by rays.

    The noise is that which the dataset states, else that of pairs measured both ways, else that of the
    roughness of the times.

    Args:
        dataset: with the travel times that were fitted.
        settings: of the image.
        residuals: histogram of its residuals, see ``residual_counts``.
        history: of its iterations. Fewer than ``FITTED`` say nothing: residuals are measured before an
            update, the first ones in water.
    """
    delta, distance = dataset.differential_tof(), dataset.distance_m()
    if settings.opening_angle_deg is not None:
        delta = np.where(within_opening(dataset, settings.opening_angle_deg), delta, np.nan)
    used = np.isfinite(delta)
    residual = residual_within(residuals, TYPICAL)
    if not used.any() or max((entry.sweep + entry.stage for entry in history), default=0) < FITTED:
        return
    time = float(np.broadcast_to(distance, delta.shape)[used].mean()) / dataset.water_speed_mps
    speed, constant = _best_constant(delta[used], np.broadcast_to(distance, delta.shape)[used], dataset)
    words = f"{_time(residual)}, {100.0 * residual / time:.2g} % of the travel times"
    if residual > SMALL * time and residual > NO_BETTER * constant:
        water = abs(speed / dataset.water_speed_mps - 1.0) < WATER
        alone = ", as in a scan of water alone" if water else ""
        yield Caution(
            "constant",
            f"One constant speed of {speed:.0f} m/s explains the times as well as the image: nine tenths of "
            f"the residuals of the image are within {words}, of the constant within {_time(constant)}. "
            f"The image shows nothing of the object{alone}; more iterations may.",
            doubtful=True,
        )
        return
    both_ways = _difference_both_ways(dataset, delta)
    stated = dataset.sigma_s is not None
    noise = (0.0 if stated else both_ways / NORMAL) or _estimated_noise(dataset)
    contradicts = both_ways > max(CONTRADICTS * constant, SMALL * time)
    if contradicts or noise > TOO_LARGE * time:
        less = f", and one constant speed of {speed:.0f} m/s leaves no more" if contradicts else ""
        yield Caution(
            "noise",
            f"The times contradict each other: their noise is {_time(noise)}, {100.0 * noise / time:.2g} % "
            f"of the travel times{less}. Another picker or more averaging may help.",
            doubtful=True,
        )
    over = residual > max(OVER_NOISE * NORMAL * noise, OF_CONSTANT * constant, SMALL * time)
    if over or residual > NORMAL * TOO_LARGE * time:
        yield Caution(
            "residual",
            f"The image does not explain the times: nine tenths of the residuals are within {words}, where "
            f"the noise is {_time(noise)}. Bent rays, more iterations or a weaker penalty may.",
            doubtful=True,
        )


def bound_cautions(
    speed: Floats, coverage: Floats, bounds_mps: tuple[float, float], water_mps: float
) -> Iterator[Caution]:
    """Whether an image is cut off by the bounds of the speed.

    Args:
        speed, coverage: (nx, ny[, nz]), m/s and m: nodes without rays keep the speed of the water.
        bounds_mps: lowest and highest speed of a node.
        water_mps: speed of the water.
    """
    crossed = speed[coverage > 0.0]
    low, high = (
        float((np.abs(crossed / bound - 1.0) < NEAR).mean())
        if crossed.size and abs(water_mps / bound - 1.0) >= NEAR
        else 0.0
        for bound in bounds_mps
    )
    if low + high >= CUT_OFF:
        yield Caution(
            "bounds",
            f"The image is cut off: {100.0 * low:.1f} % of the nodes with rays are at the lowest speed "
            f"allowed, {bounds_mps[0]:g} m/s, and {100.0 * high:.1f} % at the highest, {bounds_mps[1]:g} "
            "m/s. "
            f"If the object can be slower or faster, widen speed_bounds_mps.",
            doubtful=True,
        )


def attenuation_cautions(held_out: Floats, guided: float) -> Iterator[Caution]:
    """Whether the image of the attenuation is no better than a constant.

    Amplitudes that were read along a thin fast layer are predicted well, in wrong places.

    Args:
        held_out: of all slices, see ``attenuation.Losses``.
        guided: the largest of all slices.
    """
    _, image, constant = held_out
    numbers = held_out_amplitudes(held_out)
    if guided >= GUIDED:
        yield Caution(
            "attenuation",
            "Attenuation not better than a constant: first arrivals follow a thin fast layer, and an image "
            f"explains their amplitudes in wrong places{numbers and f' ({numbers})'}.",
        )
    elif image > 0.0 and math.sqrt(image) > CLEARLY * math.sqrt(constant):
        less = "" if image >= constant else "clearly "
        yield Caution("attenuation", f"Attenuation not {less}better than a constant: {numbers}.")


def held_out_amplitudes(held_out: Floats) -> str:
    """Root mean square misfits of held-out amplitudes, by the image and by a constant; empty without any."""
    count, *squares = held_out
    if not count:
        return ""
    image, constant = (f"{DB * math.sqrt(square / count):.3g} dB" for square in squares)
    return f"held-out amplitudes {image} against {constant}"


def with_settings_caution(result: Reconstruction, requested: Settings, *, picks: bool) -> Reconstruction:
    """The result with a caution about requested settings without effect on it, or replaced by auto.

    Args:
        result: with the settings that were used.
        requested: the settings of the user.
        picks: whether travel times were picked from traces.
    """
    amplitudes, waves = result.attenuation is not None, "waveform" in result.provenance
    facts = {"scan_amplitudes": amplitudes, "scan_traces": waves, "scan_picks": picks}
    idle = unused(result.settings, facts, requested)
    sentences = []
    if idle:
        without = "; ".join(f"{path}, unless {lacking}" for path, (_, lacking) in idle.items())
        chosen = result.settings.method
        by = "" if chosen == requested.method else f" by {chosen}, which {requested.method} chose"
        sentences.append(f"Settings without effect on this result{by}: {without}.")
    changes = []
    for setting in declared(Settings).values():
        value, used = (value_at(settings, setting.place) for settings in (requested, result.settings))
        if value not in (used, setting.default) and setting.place not in (*idle, "method"):
            changes.append(f"{setting.place} {value} by {used}")
    if changes:
        sentences.append(f"Settings replaced by auto: {', '.join(changes)}.")
    if not sentences:
        return result
    return replace(result, cautions=(*result.cautions, Caution("settings", " ".join(sentences))))


def _difference_both_ways(dataset: Dataset, delta: Floats) -> float:
    """Nine tenths of the times of pairs measured both ways differ by less, s; 0 without such pairs."""
    slices = delta.reshape(-1, *delta.shape[-2:])
    differences = np.concatenate([reciprocal_differences(dataset.tx, dataset.rx, delta) for delta in slices])
    return float(np.quantile(np.abs(differences), TYPICAL)) / math.sqrt(2.0) if differences.size else 0.0


def _estimated_noise(dataset: Dataset) -> float:
    """Standard deviation of the times, s: as stated, else of the roughness of nine tenths of them."""
    return travel_time_noise(dataset, lambda rough: float(np.quantile(np.abs(rough), TYPICAL)) / NORMAL)


def _best_constant(delta: Floats, distance: Floats, dataset: Dataset) -> tuple[float, float]:
    """The constant speed, m/s, that explains times best along straight lines, and its typical residual, s."""
    slower = float(distance @ delta) / float(distance @ distance)
    left = np.abs(delta - slower * distance)
    slowness = 1.0 / dataset.water_speed_mps + slower
    return 1.0 / slowness if slowness > 0.0 else math.inf, float(np.quantile(left, TYPICAL))


def _time(seconds: float) -> str:
    return f"{1e6 * seconds:.3g} µs" if seconds >= 1e-6 else f"{1e9 * seconds:.3g} ns"
