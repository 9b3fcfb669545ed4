"""Standard deviation of a full-waveform image: its last bands again, with each half of the emitters."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.ndimage import gaussian_filter

from ...arrays import Floats
from ..result import Iteration
from .grid_change import resampled
from .inversion_state import BandEnd, Image
from .refinement_graph import RefinementGraph
from .waveform_settings import Band, WaveSettings

# Bands of the speed that are inverted again, the last ones: together they cost about as much as the image.
BANDS = 2

# Emitters of a band at least: a half of fewer has another image altogether.
MIN_EMITTERS = 8

# Standard deviation of the Gaussian that smooths the truth, in wavelengths in water at the upper corner of
# the last band: images of four breasts were nearest to the truth smoothed by this.
WIDTH_WAVES = 0.15

# Two halves give one difference at a node, which is averaged over so many of these widths around it.
AVERAGED_WIDTHS = 3.0


class HalfRun(RefinementGraph):
    """A refinement whose iterations do not belong to the history of the image."""

    @property
    def history(self) -> tuple[Iteration, ...]:
        return self._earlier


def half_plans(plan: WaveSettings, ran: Sequence[Band] | None = None) -> tuple[WaveSettings, ...]:
    """The settings of both halves; none with too few emitters.

    Args:
        plan: of the image.
        ran: the bands of the speed that the image went through; None: all of the plan.
    """
    speed = [band for band in plan.bands if band.of == "speed"] if ran is None else list(ran)
    last = speed[-BANDS:]
    if not last or min(band.emitters for band in last) < MIN_EMITTERS:
        return ()
    bands = tuple(replace(band, emitters=band.emitters // 2) for band in last)
    return replace(plan, bands=bands, held_out=0, half=0), replace(plan, bands=bands, held_out=0, half=1)


def passes(plan: WaveSettings) -> int:
    """Emitter passes of both halves, at most."""
    return sum(band.evaluations(0) for half in half_plans(plan) for band in half.bands)


def half_plans_after(
    plan: WaveSettings, ends: Sequence[BandEnd], start: Image
) -> tuple[tuple[WaveSettings, ...], Image]:
    """The settings of both halves of a finished refinement, and the image before its last bands.

    Args:
        plan: of the refinement.
        ends: of its bands.
        start: its initial image.
    """
    ran = [k for k, end in enumerate(ends) if end.history and plan.bands[k].of == "speed"]
    first = ran[-BANDS:][0] if ran else 0
    before = ends[first - 1].image if first else start
    return half_plans(plan, [plan.bands[k] for k in ran]), before


def deviation(image: Image, halves: Sequence[Image], width_m: float) -> Floats:
    """Standard deviation of each node, (nx, ny), m/s.

    Half the difference of two independent halves has the variance of their mean (delete-half jackknife; Shao
    and Wu 1989). To it comes what the smoothing of the truth takes away, as far as the image shows it.

    Args:
        image: of all emitters.
        halves: both images.
        width_m: of the Gaussian that smooths the truth, m.
    """
    grid = image.spacing, image.origin, image.speed.shape
    first, other = (resampled(half, *grid) for half in halves)
    nodes = width_m / image.spacing
    squares = gaussian_filter((0.5 * (first - other)) ** 2, AVERAGED_WIDTHS * nodes, mode="nearest")
    squares += (image.speed - gaussian_filter(image.speed, nodes, mode="nearest")) ** 2
    return np.asarray(np.sqrt(squares))
