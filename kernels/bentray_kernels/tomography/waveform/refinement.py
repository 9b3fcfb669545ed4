"""Full-waveform refinement of a ray-based reconstruction: its task graphs, and the assembled result."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...arrays import Floats
from ..attenuation import EXPERIMENTAL
from ..cautions import bound_cautions
from ..numerics import recorded
from ..reconstruction_graph import Run, progress_of
from ..result import Reconstruction
from ..scan import Source
from ..settings import Settings
from . import half_runs
from .automatic_settings import WaveScale, wave_settings
from .grid_change import resampled
from .inversion_state import BandEnd, Image
from .refinement_graph import RefinementGraph
from .validation import ValidationGraph, evaluations, validation_settings
from .wave_scan import WaveScan
from .waveform_cost import advice
from .waveform_settings import WaveSettings

# ``auto`` gives the refined image if its misfit of held-out emitters is below this part of that before.
# Set on the scans of README, which therefore do not judge it.
CLEARLY = 0.92

# Spacing, origin and shape of an image.
Grid = tuple[float, tuple[float, float], tuple[int, ...]]


class Refinement:
    """The refinement of a scan.

    Args:
        source: of the scan.
        scale: of the scan.
        settings: with bands and emitters within the time budget.
        whole_minutes: estimated time without a budget, which ``advised`` reports.

    Attributes:
        total: largest number of emitter passes.
    """

    def __init__(self, source: Source, scale: WaveScale, settings: Settings, whole_minutes: float) -> None:
        self._source, self._settings, self._whole_minutes = source, settings, whole_minutes
        dataset = source.dataset()
        self._water_np_m = dataset.water_attenuation_np_m or 0.0
        self._plan = replace(wave_settings(scale, settings), estimates_source=source.estimates_source)
        self._of_halves = half_runs.passes(self._plan) if settings.uncertainty else 0
        self._of_image = sum(band.evaluations(self._plan.held_out) for band in self._plan.bands)
        self._water_mps = dataset.water_speed_mps
        self.total = scale.slices * (self._of_image + self._of_halves)

    def refined(self, rays: Reconstruction, run_graphs: Run, before: int) -> Reconstruction:
        """The refined reconstruction, slice after slice: the emitters of one slice occupy many workers.

        Args:
            rays: the ray-based reconstruction.
            run_graphs: runs graphs to their end.
            before: emitter passes already made.
        """
        images = _slices(rays, rays.speed)
        made, after = before, len(images) * self._of_halves
        stage = 1 + max(record.stage for record in rays.history)
        history, graphs = rays.history, []
        for index, image in enumerate(images):
            scan = WaveScan(self._source, self._plan, index)
            graphs.append(RefinementGraph(scan, image, index, history, stage))
            run_graphs(graphs[-1:], made, self._of_image * (len(images) - 1 - index) + after)
            made += graphs[-1].total
            history = graphs[-1].history
        if self._settings.method == "auto" and not misfit_ratio(graphs) < CLEARLY:
            summary = _summary(rays, self._plan, graphs)
            summary += "; not clearly better, so the image of the rays is given"
            return replace(rays, history=history, provenance={**rays.provenance, "waveform": summary})
        result = self._result(rays, graphs)
        return self._with_uncertainty(result, images, graphs, run_graphs, made) if after else result

    def _with_uncertainty(
        self,
        result: Reconstruction,
        images: Sequence[Image],
        graphs: Sequence[RefinementGraph],
        run_graphs: Run,
        made: int,
    ) -> Reconstruction:
        """The result with the standard deviations from both halves of the emitters; see ``half_runs``."""
        spread, widths = [], []
        for index, (start, graph) in enumerate(zip(images, graphs, strict=True)):
            plans, before = half_runs.half_plans_after(self._plan, graph.ends, start)
            if not plans:
                return result
            runs = [
                half_runs.HalfRun(WaveScan(self._source, plan, index), before, earlier=graph.history)
                for plan in plans
            ]
            for number, run in enumerate(runs):
                run_graphs([run], made, self._of_halves // 2 * (2 * (len(images) - index) - 1 - number))
                made += run.total
            widths.append(half_runs.WIDTH_WAVES * self._water_mps / plans[0].bands[-1].high_hz)
            deviation = half_runs.deviation(graph.image, [run.image for run in runs], widths[-1])
            spread.append(
                replace(graph.image, speed=np.where(graph.image.speed != self._water_mps, deviation, 0.0))
            )
        grid = result.spacing_m[0], (result.origin_m[0], result.origin_m[1]), result.speed.shape[:2]
        deviations = _stacked(spread, grid, result.speed.ndim)
        return replace(result, uncertainty=deviations, resolution_width_m=tuple(widths))

    @property
    def passes(self) -> int:
        """Emitter passes of ``advised``."""
        return evaluations(self._plan)

    def advised(self, rays: Reconstruction, noise_s: float, run_graphs: Run, before: int) -> Reconstruction:
        """The reconstruction with the advice whether to refine it by full waveforms, in its provenance.

        Args:
            rays: the reconstruction, with its trials; the middle one of several slices is validated.
            noise_s: standard deviation of the travel times, s.
            run_graphs: runs graphs to their end.
            before: emitter passes already made.
        """
        images = _slices(rays, rays.speed)
        index = len(images) // 2
        scan = WaveScan(self._source, validation_settings(self._plan), index)
        graph = ValidationGraph(scan, images[index], rays.history)
        run_graphs([graph], before, 0)
        advised = advice(graph.validation, rays.trials[0], noise_s, self._whole_minutes)
        return replace(rays, provenance={**rays.provenance, **advised})

    def _result(self, rays: Reconstruction, graphs: Sequence[RefinementGraph]) -> Reconstruction:
        """The result of finished graphs, on the finest of their grids."""
        images = [graph.image for graph in graphs]
        finest = min(images, key=lambda image: image.spacing)
        grid = _grid(finest)

        def stacked(images: Sequence[Image]) -> Floats:
            return _stacked(images, grid, rays.speed.ndim)

        def of_rays(values: Floats | None) -> Floats | None:
            return None if values is None else stacked(_slices(rays, values))

        attenuation = of_rays(rays.attenuation)
        # The bounds and the uncertainty of the rays do not belong to this image; it began with their misfit.
        experimental: dict[str, str] = {}
        others = {"bounds", "uncertainty"}
        losses = [image.attenuation + self._water_np_m for image in images if image.attenuation is not None]
        if len(losses) == len(images):
            pairs_of = zip(images, losses, strict=True)
            attenuation = stacked([replace(image, speed=loss) for image, loss in pairs_of])
            experimental["attenuation"] = EXPERIMENTAL
            others.add("attenuation")
        speed, coverage = stacked(images), stacked(_slices(rays, rays.coverage))
        bounds = self._settings.speed_bounds_mps
        cautions = [*bound_cautions(speed, coverage, bounds, rays.water_speed_mps)]
        cautions += [caution for caution in rays.cautions if caution.code not in others]
        return replace(
            rays,
            speed=speed,
            coverage=coverage,
            attenuation=attenuation,
            recovery=of_rays(rays.recovery),
            uncertainty=None,
            resolution_width_m=(),
            spacing_m=(finest.spacing, finest.spacing, *rays.spacing_m[2:]),
            origin_m=(*finest.origin, *rays.origin_m[2:]),
            settings=replace(self._settings, method="waveform"),
            history=progress_of(graphs[-1:]).history,
            residuals=None,
            cautions=tuple(cautions),
            provenance={
                **rays.provenance,
                "ray_numerics": rays.provenance["numerics"],
                **recorded(self._settings.numerics),
                "waveform": _summary(rays, self._plan, graphs),
                **experimental,
            },
        )


def misfit_ratio(graphs: Sequence[RefinementGraph]) -> float:
    """Misfit of held-out emitters after refinement over that before, averaged over slices.

    A band begins with the image of the previous one, so that the gains of the bands of the speed multiply.
    """
    gains = [
        math.prod(
            end.held / end.history[0].held
            for end in graph.ends
            if end.history and end.image.attenuation is None
        )
        for graph in graphs
    ]
    return sum(gains) / len(gains)


def _grid(image: Image) -> Grid:
    """The grid of an image."""
    return image.spacing, image.origin, image.speed.shape


def _stacked(images: Sequence[Image], grid: Grid, ndim: int) -> Floats:
    """Images on one grid: (nx, ny, nz), or (nx, ny) of a single slice."""
    speeds = [image.speed if _grid(image) == grid else resampled(image, *grid) for image in images]
    return np.ascontiguousarray(np.stack(speeds, axis=-1)) if ndim == 3 else speeds[0]


def _slices(rays: Reconstruction, values: Floats) -> list[Image]:
    """An array of a reconstruction as one image per slice."""
    origin = (rays.origin_m[0], rays.origin_m[1])
    slices = np.moveaxis(np.atleast_3d(values), -1, 0)
    return [Image(np.ascontiguousarray(image), rays.spacing_m[0], origin) for image in slices]


def _summary(rays: Reconstruction, plan: WaveSettings, graphs: Sequence[RefinementGraph]) -> str:
    """Bands, initial image and gain, then bands that ended early; the misfits are in the history."""
    speed = [band for band in plan.bands if band.of != "attenuation"]
    corners = f"{1e-3 * speed[0].low_hz:.0f} to {1e-3 * speed[-1].high_hz:.0f} kHz"
    method = {"sart": "SART", "gauss-newton": "Gauss-Newton"}[rays.settings.method]
    start = f"{'straight' if rays.settings.rays == 'straight' else 'bent'} rays, {method}"
    ratio = misfit_ratio(graphs)
    gain = f"{100.0 * (1.0 - ratio):.0f} % better" if ratio < 1.0 else "no better"
    text = f"full waveform, {corners}, predicts held-out emitters {gain} than its initial image ({start})"
    if plan.engine == "opencl":
        text += "; waves simulated on OpenCL devices"
    if len(speed) < len(plan.bands):
        text += "; attenuation is experimental"
    for number, band in enumerate(plan.bands):
        ends = [end for end in (graph.ends[number] for graph in graphs) if end.history or not end.skipped]
        note = _band_note(ends)
        if note:
            what = "attenuation, " if band.of == "attenuation" else ""
            text += f"; {what}{1e-3 * band.low_hz:.0f} to {1e-3 * band.high_hz:.0f} kHz: {note}"
    return text


def _band_note(ends: Sequence[BandEnd]) -> str:
    """Why a band ended early, over all slices that reached it; empty if it did not."""
    evaluated = [end for end in ends if end.history]
    if ends and not evaluated:
        return "left out, for its water shots could not be simulated"
    skipped = sum(end.skipped for end in evaluated)
    if not skipped:
        return ""
    where = f" in {skipped} slices" if len(ends) > 1 else ""
    return f"stopped{where} as the misfit rose: cycles were skipped, or noise was fitted"
