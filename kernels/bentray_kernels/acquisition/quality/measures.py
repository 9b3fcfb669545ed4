"""What the checks ask of every trace, read one emission at a time."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...arrays import Flags, Floats
from ..dataset import Dataset

# Parts of a trace, the quietest of which tells its noise.
PARTS = 8

# A pulse stands this many times above the quietest part; of noise alone the highest sample does not.
STANDS_OUT = 6.5

# So many equal samples in a row at the height of the trace mean that it was cut off there.
CUT_OFF_RUN = 3


@dataclass(frozen=True)
class Measures:
    """Figures of the traces of one slice, all (ntx, nrx).

    Attributes:
        broken: a sample is not finite.
        constant: all samples are the same.
        heard: there is a pulse.
        clipped: it was cut off at both or one of its ends.
        strongest_s: time of the crest of the envelope; NaN without a pulse.
    """

    broken: Flags
    constant: Flags
    heard: Flags
    clipped: Flags
    strongest_s: Floats

    @classmethod
    def of(cls, traces: Iterable[NDArray[Any]], dataset: Dataset) -> Measures:
        """The figures of the traces of emissions, (nrx, nt) each; only one is in memory as floating point."""
        assert dataset.sampling_rate_hz is not None
        found = [_emission(np.asarray(emission)) for emission in traces]
        broken, constant, heard, clipped, strongest = (np.stack(part) for part in zip(*found, strict=True))
        time = np.where(heard, dataset.t0_s + strongest / dataset.sampling_rate_hz, np.nan)
        return cls(broken, constant, heard, clipped, time)

    @classmethod
    def joined(cls, parts: Sequence[Measures]) -> Measures:
        """The figures of all emissions from those of some each, in their order."""
        names = [field.name for field in fields(cls)]
        return cls(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))


def _emission(traces: NDArray[Any]) -> tuple[Flags, Flags, Flags, Flags, Floats]:
    x = traces.astype(np.float64)
    broken = np.asarray(~np.isfinite(x).all(axis=1))
    x[broken] = 0.0
    constant = (np.ptp(x, axis=1) == 0.0) & ~broken
    offset = np.median(x, axis=1, keepdims=True)
    centred = np.abs(x - offset)
    peak = centred.max(axis=1)
    parts = np.array_split(centred, min(PARTS, x.shape[1]), axis=1)
    quiet = np.min([np.sqrt((part**2).mean(axis=1)) for part in parts], axis=0)
    heard = (peak > STANDS_OUT * quiet) & ~broken & ~constant
    # Small whole numbers repeat by themselves: only heights of many steps can be told to be cut off.
    steps = 20.0 if traces.dtype.kind == "i" else 0.0
    clipped = heard & (peak > steps) & (_run(x, x.max(axis=1)) | _run(x, x.min(axis=1)))
    # Of the swings themselves the strongest changes from pulse to pulse; their envelope has one crest.
    envelope = _envelope(x - offset)
    return broken, constant, heard, clipped, _vertex(envelope, np.argmax(envelope, axis=1))


def _envelope(x: Floats) -> Floats:
    """Magnitude of the analytic signal along time, (traces, nt).

    As ``scipy.signal.hilbert`` has it, which would bring 26 MB into every process that knows this module.
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
    """Place of the highest sample, to a fraction of one by a parabola."""
    row = np.arange(len(size))
    inner = np.clip(at, 1, size.shape[1] - 2) if size.shape[1] > 2 else at
    if size.shape[1] < 3:
        return at.astype(np.float64)
    left, middle, right = size[row, inner - 1], size[row, inner], size[row, inner + 1]
    bend = left - 2.0 * middle + right
    part = np.where(bend < 0.0, 0.5 * (left - right) / np.where(bend < 0.0, bend, 1.0), 0.0)
    return np.asarray(at + np.where(inner == at, part, 0.0))
