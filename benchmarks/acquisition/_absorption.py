"""Wave simulation with attenuation proportional to the frequency, for synthetic scans."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from bentray_kernels.arrays import Floats
from bentray_kernels.compilation.compiled import kernel
from bentray_kernels.errors import InvalidInput
from bentray_kernels.wave.light_cone import everywhere
from bentray_kernels.wave.medium import EDGE_NODES, Medium
from bentray_kernels.wave.simulation import place_scan
from bentray_kernels.wave.stencil import HALO, longest_step, weights
from bentray_kernels.wave.time_step import advance, inject, read


@dataclass(frozen=True)
class Absorbing:
    """A medium with one relaxation process (standard linear solid) about one frequency.

    The compressibility is (1 + D / (1 + i w T)) times the unrelaxed one (Debye; Zener). With
    T = 1 / (2 pi f0) the loss per wavelength has its maximum at f0, so that the attenuation grows in
    proportion to the frequency about it: within 3 % from 0.8 to 1.25 f0, 12 % from 0.6 to 1.65 f0. The model
    is causal and therefore dispersive, like tissue: speed and attenuation are exact at f0.

    With x the relaxing part of the compression, in units of the pressure,

        p'' + D/T p' - D/T^2 p + x/T^2 = c^2 (laplacian p + s),    T x' = D p - x

    so that a time step is that of ``Medium`` with other factors, less ``pull`` x.

    Attributes:
        medium: of the unrelaxed speed c.
        pull, gain: (nx + 2 margin, ny + 2 margin), factors of x, and of the pressure in its next value.
        stay: factor of x in its next value.
    """

    medium: Medium
    pull: NDArray[np.floating]
    gain: NDArray[np.floating]
    stay: float

    @classmethod
    def from_speed(
        cls,
        speed: Floats,
        spacing: float,
        time_step_s: float,
        *,
        attenuation: Floats,
        frequency_hz: float,
        edge_nodes: int = EDGE_NODES,
        dtype: DTypeLike = np.float32,
    ) -> Absorbing:
        """The medium of an image, its outermost values continued through the edges.

        Args:
            speed: (nx, ny), m/s, of the phase at ``frequency_hz``.
            spacing: of the nodes, m.
            time_step_s: s.
            attenuation: (nx, ny), Np/m at ``frequency_hz``, >= 0 and below 0.4 of its wave number.
            frequency_hz: f0.
            edge_nodes: width of the absorbing edges, nodes.
            dtype: of the fields.

        Raises:
            InvalidInput: as ``Medium.from_speed``, and for an invalid frequency or attenuation.
        """
        if not 0.0 < frequency_hz < np.inf:
            raise InvalidInput("frequency_hz", frequency_hz, "a finite frequency > 0 Hz")
        turn = 2.0 * np.pi * frequency_hz
        speed = np.asarray(speed, dtype=np.float64)
        loss = np.asarray(attenuation, dtype=np.float64)
        if loss.shape != speed.shape or not ((loss >= 0.0) & (loss * speed < 0.4 * turn)).all():
            raise InvalidInput(
                "attenuation",
                f"shape {loss.shape}",
                f"{speed.shape} of numbers from 0 to below 0.4 w / c Np/m",
            )
        # (w/c0 - i a)^2 = (w/c)^2 (1 + D/2 - i D/2) at w T = 1.
        lost = 2.0 * loss * turn / speed
        fast = turn / np.sqrt((turn / speed) ** 2 - loss**2 - lost)
        medium = Medium.from_speed(fast, spacing, time_step_s, edge_nodes=edge_nodes, dtype=np.float64)
        behind = np.subtract(medium.keep.shape, loss.shape) - medium.margin
        widths = [(medium.margin, int(width)) for width in behind]
        lagging = np.pad(2.0 * lost * (fast / turn) ** 2, widths, mode="edge")
        sponge = (1.0 - medium.fade) / (1.0 + medium.fade)
        step = turn * time_step_s
        turned = sponge + 0.5 * lagging * step
        limit = longest_step(float(fast.max()), spacing, float(turned.max()) / time_step_s)
        if time_step_s > limit:
            raise InvalidInput("time_step_s", time_step_s, f"a step > 0 and <= {limit:.4g} s, to be stable")
        keep = (2.0 - sponge**2 + lagging * step**2) / (1.0 + turned)
        fade = (1.0 - turned) / (1.0 + turned)
        drive = medium.drive * (1.0 + sponge) / (1.0 + turned)
        keep, fade, drive, pull, gain = (
            np.ascontiguousarray(array, dtype=dtype)
            for array in (
                keep,
                fade,
                drive,
                step**2 / (1.0 + turned),
                0.5 * step * lagging / (1.0 + 0.5 * step),
            )
        )
        whole = Medium(keep, fade, drive, medium.speed, spacing, time_step_s, medium.margin)
        return cls(whole, pull, gain, (1.0 - 0.5 * step) / (1.0 + 0.5 * step))


def simulate_absorbed(
    absorbing: Absorbing, emitter: Floats, receivers: Floats, wavelet: Floats, order: int = 2 * HALO
) -> Floats:
    """Traces of a point source, as ``simulation.simulate`` gives them; releases the GIL.

    Args:
        absorbing: the medium.
        emitter: (2,), m, node 0 of the image at 0.
        receivers: (nrx, 2), m.
        wavelet: (nt,), a sample a time step.
        order: in space.

    Returns:
        (nrx, nt), of the medium's type.

    Raises:
        InvalidInput: as ``simulation.simulate``.
    """
    medium = absorbing.medium
    kind = medium.keep.dtype
    source, detectors = place_scan(medium, emitter, receivers, wavelet)
    traces = np.empty((len(detectors.first), wavelet.size), kind)
    fields = np.zeros((3, *medium.keep.shape), kind)
    scale = float(np.abs(wavelet).max())
    _simulate(
        fields[0],
        fields[1],
        fields[2],
        medium.keep,
        medium.fade,
        medium.drive,
        absorbing.pull,
        absorbing.gain,
        kind.type(absorbing.stay),
        weights(order).astype(kind),
        source.first[0],
        source.weights[0],
        detectors.first,
        detectors.weights,
        (wavelet / scale).astype(kind),
        traces,
        everywhere(medium)[0],
    )
    traces *= kind.type(scale)
    return traces


@kernel
def _simulate(
    now: Any,
    old: Any,
    lag: Any,
    keep: Any,
    fade: Any,
    drive: Any,
    pull: Any,
    gain: Any,
    stay: Any,
    weights: Any,
    first: Any,
    along: Any,
    detector_first: Any,
    detector_along: Any,
    wavelet: Any,
    traces: Any,
    spans: Any,
) -> None:
    for n in range(wavelet.size):
        for r in range(traces.shape[0]):
            traces[r, n] = read(now, detector_first[r], detector_along[r])
        advance(now, old, keep, fade, drive, weights, spans)
        inject(old, drive, first, along, wavelet[n])
        _relax(now, old, lag, pull, gain, stay)
        now, old = old, now


@kernel(inline="always")
def _relax(now: Any, new: Any, lag: Any, pull: Any, gain: Any, stay: Any) -> None:
    """Subtract the relaxing part from the field after a step, then advance it to the end of the step."""
    for i in range(HALO, now.shape[0] - HALO):
        here, there, late, pulled, gained = now[i], new[i], lag[i], pull[i], gain[i]
        for j in range(HALO, now.shape[1] - HALO):
            there[j] -= pulled[j] * late[j]
            late[j] = stay * late[j] + gained[j] * (here[j] + there[j])
