"""Acoustic medium: speed, loss and absorbing edges, as the factors of one time step."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import reduce

import numpy as np
from numpy.typing import DTypeLike, NDArray

from ..arrays import Floats, refuse_mask
from ..errors import InvalidInput
from .cache_lines import missing, zeros
from .memory import check_memory
from .stencil import HALO, Order, longest_step

# Width of the absorbing edge, nodes; power of its profile; theoretical reflection at normal incidence. Among
# powers 2 to 4 and reflections 1e-3 to 1e-6 these reflect least: 1 % of waves of 15 nodes, 0.4 % of 7.5.
EDGE_NODES = 20
EDGE_POWER = 2
EDGE_REFLECTION = 1e-3


@dataclass(frozen=True)
class Medium:
    """Factors of (d/dt + sigma)^2 p = c^2 (laplacian p + s), by central differences in time:

        next = keep * now - fade * before + drive * (h^2 laplacian now + sources)

    Loss: a wave p = exp(-sigma t) q, with a lossless q, solves it in a uniform medium. So the attenuation is
    sigma / c at every frequency, without dispersion. That of tissue grows nearly as the frequency; use its
    value at the centre of the band. The edges have the same term, growing outwards as a power (a sponge).

    Attributes:
        keep, fade, drive: (nx + 2 margin, ny + 2 margin[, nz + 2 margin]), float32 or float64; the rows of a
            plane are filled up to whole cache lines, see ``cache_lines``.
        speed: (nx, ny[, nz]), m/s, of the image alone.
        spacing: m.
        time_step_s: s.
        margin: nodes of edge and halo on every side of the image.
        order: of the Laplacian, see ``stencil.weights``.
    """

    keep: NDArray[np.floating]
    fade: NDArray[np.floating]
    drive: NDArray[np.floating]
    speed: Floats
    spacing: float
    time_step_s: float
    margin: int
    order: Order = 2 * HALO

    @property
    def factors(self) -> tuple[NDArray[np.floating], NDArray[np.floating], NDArray[np.floating]]:
        """keep, fade and drive, as the compiled time steps take them."""
        return self.keep, self.fade, self.drive

    @classmethod
    def from_speed(
        cls,
        speed: Floats,
        spacing: float,
        time_step_s: float,
        *,
        attenuation: Floats | None = None,
        edge_nodes: int = EDGE_NODES,
        dtype: DTypeLike = np.float32,
        memory_bytes: float = math.inf,
        order: Order = 2 * HALO,
    ) -> Medium:
        """The medium of an image, its outermost values continued through the edges.

        Args:
            speed: (nx, ny[, nz]), m/s, > 0.
            spacing: of the nodes, m.
            time_step_s: s.
            attenuation: as ``speed``, Np/m, >= 0; None: no loss.
            edge_nodes: width of the absorbing edges, nodes.
            dtype: of the fields; float64 for tests of exactness.
            memory_bytes: limit for one emission, see ``wave.memory.emission_bytes``.
            order: in space, see ``stencil.weights``. Synthetic data for an inversion should use another one.

        Raises:
            InvalidInput: for an invalid speed or attenuation, an edge without a node, a time step beyond
                the limit of stability, or more memory than the limit.
        """
        refuse_mask("speed", speed)
        speed = np.asarray(speed, dtype=np.float64)
        if speed.ndim not in (2, 3) or 0 in speed.shape or not (np.isfinite(speed) & (speed > 0.0)).all():
            raise InvalidInput("speed", f"shape {speed.shape}", "(nx, ny[, nz]) of finite numbers > 0 m/s")
        if not 0.0 < spacing < np.inf:
            raise InvalidInput("spacing", spacing, "a finite spacing > 0 m")
        if edge_nodes < 1:
            raise InvalidInput("edge_nodes", edge_nodes, "at least 1 node")
        check_memory(speed.shape, edge_nodes, dtype, memory_bytes)
        margin = edge_nodes + HALO
        width = _padding(speed.shape, margin)
        c = np.pad(speed, width, mode="edge")
        # By the speed at the boundary, so that no change of the object changes the edges.
        faces = [speed.take(end, axis).ravel() for axis in range(speed.ndim) for end in (0, -1)]
        rim = np.concatenate(faces).mean()
        damping = _sponge(speed.shape, edge_nodes) * rim / spacing
        if attenuation is not None:
            refuse_mask("attenuation", attenuation)
            loss = np.asarray(attenuation, dtype=np.float64)
            if loss.shape != speed.shape or not (np.isfinite(loss) & (loss >= 0.0)).all():
                raise InvalidInput(
                    "attenuation", f"shape {loss.shape}", f"{speed.shape} of finite numbers >= 0 Np/m"
                )
            damping = damping + c * np.pad(loss, width, mode="edge")
        limit = longest_step(float(c.max()), spacing, float(damping.max()), speed.ndim, order)
        if not 0.0 < time_step_s <= limit:
            raise InvalidInput("time_step_s", time_step_s, f"a step > 0 and <= {limit:.4g} s, to be stable")
        turn = damping * time_step_s
        del damping
        # Converted one after the other: in 3-D they dominate the memory.
        keep = _converted((2.0 - turn**2) / (1.0 + turn), dtype)
        fade = _converted((1.0 - turn) / (1.0 + turn), dtype)
        drive = _converted((c * time_step_s / spacing) ** 2 / (1.0 + turn), dtype)
        return cls(keep, fade, drive, speed, spacing, time_step_s, margin, order)


def _converted(values: Floats, dtype: DTypeLike) -> NDArray[np.floating]:
    converted = zeros(values.shape, dtype)
    converted[...] = values
    return converted


def _padding(shape: tuple[int, ...], margin: int) -> list[tuple[int, int]]:
    """Nodes before and behind an image along each axis; rows of a plane are whole cache lines."""
    tail = missing(shape[1] + 2 * margin) if len(shape) == 2 else 0
    return [(margin, margin)] * (len(shape) - 1) + [(margin, margin + tail)]


def _sponge(shape: tuple[int, ...], edge_nodes: int) -> Floats:
    """Damping of the edges times spacing over speed, on the padded grid.

    A wave that crosses the edge, is reflected at its end and crosses it again keeps EDGE_REFLECTION.
    """
    strongest = -0.5 * (EDGE_POWER + 1) * np.log(EDGE_REFLECTION) / edge_nodes
    margin = edge_nodes + HALO
    profiles = []
    for nodes, width in zip(shape, _padding(shape, margin), strict=True):
        node = np.arange(nodes + sum(width)) - margin
        depth = np.clip(np.maximum(-node, node - (nodes - 1)) / edge_nodes, 0.0, 1.0)
        profiles.append(strongest * depth**EDGE_POWER)
    return np.asarray(reduce(np.maximum, np.ix_(*profiles)))
