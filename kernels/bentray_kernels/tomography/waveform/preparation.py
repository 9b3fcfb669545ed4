"""The inverse problem of a band from a dataset: grid, time steps, pairs and drawn emitters."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...acquisition import Dataset, Waveform
from ...acquisition.array_hull import inside_array
from ...arrays import Flags, Ints
from ...errors import InvalidInput
from ...wave.points import REACH
from ...wave.time_blocks import Poll, no_poll
from ..directivity import within_opening
from ..roi import inside
from .band_grid import Extent
from .source_calibration import WaterShots, with_calibrated_source, with_normalised_amplitudes
from .trace_resampling import Clock, Water
from .waveform_problem import WaveProblem
from .waveform_settings import WaveSettings


def prepare(dataset: Dataset, settings: WaveSettings, number: int, *, poll: Poll = no_poll) -> WaveProblem:
    """The problem of a slice in band ``number``, with wavelet and phase speed of the water from water shots.

    It holds the object traces of the emitters that the band uses. Traces given as
    ``acquisition.emissions.Emissions`` are read one emission at a time.

    Args:
        dataset: one slice with traces of object and water.
        settings: of the refinement.
        number: of the band, from 0.
        poll: of all simulations, see ``time_blocks``.

    Raises:
        InvalidInput: for a dataset without traces or, if the settings require one, without a region of
            interest; with all emitters held out, no node inside the array, or traces of zeros alone.
    """
    recorded = dataset.waveform
    if recorded is None or recorded.water is None or dataset.sampling_rate_hz is None:
        raise InvalidInput("waveform/water", "none", "traces of object and water to refine from")
    if recorded.object.ndim != 3 or dataset.element_position_m.shape[1] != 2:
        raise InvalidInput("waveform/object", f"shape {recorded.object.shape}", "one slice in a plane")
    band, spacing = settings.bands[number], settings.bands[number].spacing_m
    flat = dataset.element_position_m
    centre = 0.5 * (flat.min(axis=0) + flat.max(axis=0))
    samples = dataset.t0_s + np.arange(recorded.object.shape[-1]) / dataset.sampling_rate_hz
    reach = float(np.abs(flat - centre).max())
    extent = Extent.for_scan(band, reach, float(samples[-1] - samples[0]), settings.speed_bounds_mps[1])
    nodes = extent.nodes
    axis = spacing * (np.arange(nodes) - 0.5 * (nodes - 1))
    origin = centre + axis[0]
    corner = (float(origin[0]), float(origin[1]))
    elements = flat[np.union1d(dataset.tx, dataset.rx)]
    region = inside_array(elements, (nodes, nodes), spacing, corner, REACH)
    if settings.roi:
        region &= inside(dataset, region.shape, spacing, corner)
    if not region.any():
        raise InvalidInput("spacing_m", spacing, "nodes inside the array and the region of interest")
    clock = Clock(dataset.t0_s - extent.lead_s, extent.step_s, extent.steps)
    gain, water_gain = (
        recorded.scale * (np.ones(recorded.object.shape[:2]) if factor is None else factor)
        for factor in (recorded.object_scale, recorded.water_scale)
    )
    use = dataset.distance_m() >= settings.nearest_m
    use &= np.isfinite(gain) & np.isfinite(water_gain)
    if dataset.valid is not None:
        use &= dataset.valid
    if settings.opening_angle_deg is not None:
        use &= within_opening(dataset, settings.opening_angle_deg)
    used, held = _draw_emitters(np.flatnonzero(use.any(axis=1)), settings, number)
    traces, use = _without_dead_traces(recorded, use, np.concatenate((used, held)))
    used, held = (emitters[use[emitters].any(axis=1)] for emitters in (used, held))
    if used.size == 0:
        raise InvalidInput(
            "waveform/object, waveform/water", "zeros alone", "traces of both for some emitters"
        )
    problem = WaveProblem(
        band=band,
        emitters=flat[dataset.tx] - origin,
        receivers=flat[dataset.rx] - origin,
        region=region,
        origin=corner,
        clock=clock,
        wavelet=np.zeros(clock.steps),
        water=Water(dataset.water_speed_mps),
        water_correlation=0.0,
        weight=use.astype(np.float64),
        arrival_s=dataset.distance_m() / dataset.water_speed_mps,
        traces=traces,
        gain=gain,
        sampler=np.empty((0, 0), dtype=np.float32),
        used=used,
        held=held,
        every=extent.every,
        poll=poll,
    )
    shots = WaterShots(recorded.water, water_gain, samples, settings.window_s)
    problem = with_calibrated_source(problem, shots)
    return problem if band.of == "speed" else with_normalised_amplitudes(problem, shots)


def _without_dead_traces(
    recorded: Waveform, use: Flags, emitters: Ints
) -> tuple[dict[int, NDArray[Any]], Flags]:
    """Object traces of some emitters, and (ntx, nrx) the pairs to use without those of dead traces.

    The traces are copies, because an emission may be a view of a larger block.
    """
    by_emitter, use = {}, use.copy()
    for emitter in np.sort(emitters).tolist():
        by_emitter[emitter] = recorded.object[emitter].copy()
        for traces in (by_emitter[emitter], recorded.water_traces[emitter]):
            use[emitter] &= (traces != 0).any(axis=-1)
    return by_emitter, use


def _draw_emitters(candidates: Ints, settings: WaveSettings, number: int) -> tuple[Ints, Ints]:
    """The emitters of a band, different in each band, and the held-out ones, the same in all bands.

    The circle is divided into as many parts as emitters are requested; one is drawn from each part.
    """
    indices = np.linspace(0, candidates.size, settings.held_out, endpoint=False).astype(np.int64)
    held = candidates[np.unique(indices)] if candidates.size else candidates
    rest = np.setdiff1d(candidates, held)
    if rest.size == 0:
        raise InvalidInput("held_out", settings.held_out, f"fewer than the {candidates.size} emitters")
    # Both halves draw the same emitters, and each takes every other one.
    requested = settings.bands[number].emitters * (1 if settings.half is None else 2)
    count = min(requested, rest.size)
    edges = np.linspace(0, rest.size, count + 1)
    chance = np.random.default_rng((settings.seed, number)).random(count)
    drawn = (edges[:-1] + chance * np.diff(edges)).astype(np.int64)
    drawn = np.unique(np.minimum(drawn, rest.size - 1))
    return rest[drawn if settings.half is None else drawn[settings.half :: 2]], held
