"""Guided picking: arrivals are picked again near the times that the image predicts."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ..acquisition import Dataset, pick
from ..acquisition.picking.amplitudes import with_log_ratios
from ..arrays import Floats
from ..errors import InvalidInput
from .gauss_newton.gauss_newton_step import trace_rays
from .problem import Problem
from .reconstruction import reconstruct
from .result import Progress, Reconstruction
from .settings import Settings

# Picks that move less than this between rounds, s, would give the same image again.
SETTLED_S = 1e-9


def reconstruct_guided(
    dataset: Dataset,
    settings: Settings,
    rounds: int = 2,
    *,
    reach_s: float | None = None,
    progress: Callable[[Progress], None] | None = None,
) -> tuple[Dataset, Reconstruction]:
    """Pick, reconstruct, and pick again about the arrivals that the image predicts.

    A first arrival that noise or a weak path hides from the picker is found near the time that the image of
    the other pairs predicts; a pick on a wrong cycle is not repeated.

    Args:
        dataset: with traces; see ``acquisition.pick``.
        settings: of the reconstructions, slice by slice, with the picker.
        rounds: how often times are picked again; it ends sooner once they stay.
        reach_s: how far from the prediction a pick may lie, s; None: a period.
        progress: of each reconstruction.

    Returns:
        The dataset as last picked, and its reconstruction.

    Raises:
        InvalidInput: as ``pick`` and ``reconstruct``; for a negative number of rounds, or a volume.
    """
    if rounds < 0:
        raise InvalidInput("rounds", rounds, "a number >= 0")
    picked = _with_amplitudes(dataset, pick(dataset, settings.picking.picker), settings)
    result = reconstruct(_with_traces(picked, dataset, settings), settings, progress)
    for _ in range(rounds):
        expected = predicted_delta(picked, result)
        again = pick(dataset, settings.picking.picker, predicted_s=expected, reach_s=reach_s)
        again = _with_amplitudes(dataset, again, settings)
        settled = same_picks(picked, again)
        picked = again
        if settled:
            break
        result = reconstruct(_with_traces(picked, dataset, settings), settings, progress)
    return picked, result


def _with_amplitudes(dataset: Dataset, picked: Dataset, settings: Settings) -> Dataset:
    """What was picked, with the amplitudes that the settings want from the traces."""
    if not settings.reads_amplitudes:
        return picked
    with_ratios = with_log_ratios(replace(picked, waveform=dataset.waveform), settings.attenuation.amplitudes)
    return replace(with_ratios, waveform=None)


def _with_traces(picked: Dataset, dataset: Dataset, settings: Settings) -> Dataset:
    """The picked dataset, with the traces that held-out validation needs."""
    return replace(picked, waveform=dataset.waveform) if settings.selects_model else picked


def predicted_delta(dataset: Dataset, result: Reconstruction) -> Floats:
    """Travel time object minus water of every pair as an image has it, (…, ntx, nrx), s.

    Along the rays that the image was made with, bent to the stationary path where they are curved.

    Args:
        dataset: whose elements and slices the image is of.
        result: made slice by slice.

    Raises:
        InvalidInput: for a volume, or an array in space.
    """
    settings = result.settings
    if settings.decomposition != "slices":
        raise InvalidInput("decomposition", repr(settings.decomposition), "slices, to pick with a prediction")
    if dataset.element_position_m.shape[1] != 2:
        raise InvalidInput(
            "geometry/element_position_m",
            "elements in space",
            "elements in a plane, to pick with a prediction",
        )
    shape = (len(dataset.tx), len(dataset.rx))
    level = dataset.tx[:, None] == dataset.rx[None, :]
    whole = shape if dataset.slice_z_m is None else (dataset.slices, *shape)
    # With a measured difference of 0 for every pair, the residual is minus the prediction.
    zeroed = replace(
        dataset, delta_tof_s=np.zeros(whole), tof_s=None, sigma_s=None, valid=None, log_ratio_np=None
    )
    found = np.full((dataset.slices, *shape), np.nan)
    for index in range(dataset.slices):
        problem = Problem.of(zeroed, settings.changed(reciprocity=False), index)
        speed = result.speed if result.speed.ndim == 2 else result.speed[:, :, index]
        rows = trace_rays(problem, settings, 1.0 / speed, np.arange(len(dataset.tx)))
        found[index][~level] = -rows.residual
    return found[0] if dataset.slice_z_m is None else found


def same_picks(before: Dataset, after: Dataset) -> bool:
    """Whether the picks are those of the round before."""
    was, found = before.differential_tof(), after.differential_tof()
    known = np.isfinite(was)
    if (known != np.isfinite(found)).any():
        return False
    change = (found - was)[known]
    return not change.size or float(np.sqrt(np.mean(change**2))) < SETTLED_S
