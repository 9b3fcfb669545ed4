"""Measures of every trace for the checks, computed one emission at a time."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...arrays import Flags, Floats
from ..dataset import Dataset

# Parts of a trace; the quietest one gives the noise.
PARTS = 8

# Lowest ratio of a pulse to the quietest part; the highest sample of pure noise is below.
STANDS_OUT = 6.5

# Equal samples in a row at the maximum of a clipped trace.
CUT_OFF_RUN = 3


@dataclass(frozen=True)
class Measures:
    """Measures of the traces of one slice, all (ntx, nrx).

    Attributes:
        broken: a sample is not finite.
        constant: all samples are the same.
        detected: there is a pulse.
        clipped: it is clipped at its maximum, minimum or both.
        strongest_s: time of the maximum of the envelope; NaN without a pulse.
        peak: largest distance from the median, in counts.
    """

    broken: Flags
    constant: Flags
    detected: Flags
    clipped: Flags
    strongest_s: Floats
    peak: Floats

    @classmethod
    def from_traces(cls, traces: Iterable[NDArray[Any]], dataset: Dataset) -> Measures:
        """Measures of the traces of emissions, (nrx, nt) each; converted to floating point one by one."""
        rows = [_emission(np.asarray(emission)) for emission in traces]
        broken, constant, detected, clipped, strongest, peak = (
            np.stack(rows_of_field) for rows_of_field in zip(*rows, strict=True)
        )
        time = np.where(detected, dataset.t0_s + strongest / dataset.rate_hz, np.nan)
        return cls(broken, constant, detected, clipped, time, peak)

    @property
    def unclipped_s(self) -> Floats:
        """Times of the maxima, (ntx, nrx), s; where most pulses are complete, without clipped ones.

        Clipped maxima are off by a fraction of a period, and strong near pairs are clipped: the fit of a line
        would be biased.
        """
        unclipped = np.where(self.clipped, np.nan, self.strongest_s)
        most = 2 * np.isfinite(unclipped).sum() >= np.isfinite(self.strongest_s).sum()
        return unclipped if most else self.strongest_s

    @classmethod
    def joined(cls, measures: Sequence[Measures]) -> Measures:
        """Concatenate the measures of parts of the emissions, in order."""
        names = [field.name for field in fields(cls)]
        return cls(*(np.concatenate([getattr(measure, name) for measure in measures]) for name in names))


def _emission(traces: NDArray[Any]) -> tuple[Flags, Flags, Flags, Flags, Floats, Floats]:
    x = traces.astype(np.float64)
    broken = np.asarray(~np.isfinite(x).all(axis=1))
    x[broken] = 0.0
    constant = (np.ptp(x, axis=1) == 0.0) & ~broken
    offset = np.median(x, axis=1, keepdims=True)
    centred = np.abs(x - offset)
    peak = centred.max(axis=1)
    blocks = np.array_split(centred, min(PARTS, x.shape[1]), axis=1)
    quiet = np.min([np.sqrt((block**2).mean(axis=1)) for block in blocks], axis=0)
    detected = (peak > STANDS_OUT * quiet) & ~broken & ~constant
    # Small integers repeat by chance: clipping is detected only at amplitudes of many steps.
    steps = 20.0 if traces.dtype.kind == "i" else 0.0
    clipped = detected & (peak > steps) & (_run(x, x.max(axis=1)) | _run(x, x.min(axis=1)))
    # The strongest extremum differs between pulses; their envelope has one maximum.
    envelope = _envelope(x - offset)
    return broken, constant, detected, clipped, _vertex(envelope, np.argmax(envelope, axis=1)), peak


def _envelope(x: Floats) -> Floats:
    """Magnitude of the analytic signal along time, (traces, nt).

    As ``scipy.signal.hilbert``, whose import would add 26 MB to every process that imports this module.
    """
    samples = x.shape[1]
    weight = np.zeros(samples)
    weight[0] = 1.0
    weight[1 : (samples + 1) // 2] = 2.0
    if samples % 2 == 0:
        weight[samples // 2] = 1.0
    return np.abs(np.fft.ifft(np.fft.fft(x, axis=1) * weight, axis=1))


def _run(x: Floats, height: Floats) -> Flags:
    """Whether a trace stays at a height for ``CUT_OFF_RUN`` samples."""
    at = x == height[:, None]
    count = at.shape[1] - CUT_OFF_RUN + 1
    if count < 1:
        return np.zeros(len(x), dtype=bool)
    whole = np.logical_and.reduce([at[:, k : k + count] for k in range(CUT_OFF_RUN)])
    return np.asarray(whole.any(axis=1))


def _vertex(size: Floats, at: NDArray[np.intp]) -> Floats:
    """Position of the highest sample, refined by a parabola."""
    row = np.arange(len(size))
    inner = np.clip(at, 1, size.shape[1] - 2) if size.shape[1] > 2 else at
    if size.shape[1] < 3:
        return at.astype(np.float64)
    left, middle, right = size[row, inner - 1], size[row, inner], size[row, inner + 1]
    bend = left - 2.0 * middle + right
    fraction = np.where(bend < 0.0, 0.5 * (left - right) / np.where(bend < 0.0, bend, 1.0), 0.0)
    return np.asarray(at + np.where(inner == at, fraction, 0.0))
