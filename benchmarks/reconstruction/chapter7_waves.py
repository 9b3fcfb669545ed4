"""M1: slices of the 3-D breast phantom (Li 2008, Table 7) scanned by waves; full-waveform inversion."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from bentray_kernels.acquisition import Dataset, pick
from bentray_kernels.arrays import Floats
from bentray_kernels.phantoms import TABLE7_SIDE_M, table7_slices
from bentray_kernels.tomography import Settings
from bentray_service.cli.output.benchmark_context import BenchmarkContext
from bentray_service.cli.output.benchmark_row import DEFAULT_SETTINGS, STRAIGHT_RAYS, Row
from bentray_workers.simulation.simulation_run import simulate

from ..shared._baselines import Images
from ..shared._recorded_scans import with_trace_noise
from ._sections_picture import Panel, picture
from ._table7_errors import Slices, contrasts, least_contrast, on_phantom_nodes
from ._table7_slices import NODES, SliceWaves

# Root mean square errors over the range of the whole image (section 7.3.1).
BY_SLICES, IN_SPACE = 0.036, 0.034

# "Clearly identified", in numbers of ours: half of the true contrast.
VISIBLE, SMALLEST_VOXELS = 0.5, 2

WATER_MPS = 1500.0

# The frequency was chosen on the slice at the centre; others, of the 40 heights, judge it. The curvature that
# a band of frequency begins with was chosen on that at -13.4 mm among others.
# A slice takes eight minutes of an idle core, so that not all are measured.
CENTRE_M, HEIGHTS, JUDGED = 0.0, 40, (11,)

SIZE: dict[str, Any] = {"frequency_hz": 3e5, "elements": 256, "emissions": 64}
QUICK: dict[str, Any] = {"frequency_hz": 1e5, "elements": 48, "emissions": 12}

SNR = 10.0

WAVEFORM = "waveform"
# No loss is simulated.
SETTINGS = {
    DEFAULT_SETTINGS: Settings(),
    WAVEFORM: Settings.from_values(method="waveform", attenuation=False),
}

NO_SPACE = (
    "full-waveform inversion works slice by slice. In space its last band at this size has 13 million nodes, "
    "an estimated 80 s of a core for each emitter pass, so 7 hours for one height of the ring and ten days "
    "for 40; rays in space: R9 of reconstruction_volume"
)


@dataclass(frozen=True)
class Scanned:
    """A slice and its images.

    Attributes:
        asked: the scan.
        speeds: by the way they were made, on the nodes of the phantom, m/s.
        summary: of the inversion: bands, and gain on held-out emitters.
    """

    asked: SliceWaves
    speeds: Mapping[str, Floats]
    summary: str

    @property
    def section(self) -> str:
        """Height of the slice."""
        return f"z = {1e3 * self.asked.z_m:.1f} mm"


def rows(context: BenchmarkContext) -> Iterable[Row]:
    """Errors of waveforms and of the default settings, and the contrast of lesions, on the judged slices."""
    heights = table7_slices(NODES, HEIGHTS)[list(JUDGED)].tolist()
    size = QUICK if context.quick else SIZE
    chosen: list[Scanned] = []
    judged: list[Scanned] = []
    noisy: list[Scanned] = []
    for z in (CENTRE_M, *(() if context.quick else heights)):
        asked = SliceWaves(**size, coupling_mps=WATER_MPS, z_m=z)
        what = f"waves, z = {1e3 * z:.1f} mm"
        dataset = simulate(asked, lambda p, what=what: context.progress(p.done, p.total, what))
        (chosen if z == CENTRE_M else judged).append(scanned(context, asked, dataset))
        if context.quick or z == heights[0]:
            noisy.append(scanned(context, asked, with_trace_noise(dataset, SNR)))
    yield from summarised(chosen, judged, noisy)
    context.save_picture("chapter7_waves.png", lambda: drawn([*chosen, *judged], noisy))


def summarised(
    chosen: Sequence[Scanned], judged: Sequence[Scanned], noisy: Sequence[Scanned]
) -> Iterator[Row]:
    """The rows of slices that the frequency was chosen on, of those that judge it, and of some with noise."""
    for name, slices in (("slice at the centre", chosen), ("slices", judged), (f"slice, SNR {SNR:g}", noisy)):
        if slices:
            yield from errors(name, slices)
    for name, slices in (("no noise", [*chosen, *judged]), (f"SNR {SNR:g}", noisy)):
        if not slices:
            continue
        inside = {scan.section: contrasts(scan.asked.phantom, scan.speeds[WAVEFORM]) for scan in slices}
        least = np.nanmin([least_contrast(each, SMALLEST_VOXELS) for each in inside.values()])
        facts = (
            f"{where}, {what}: {read:.2f}" for where, each in inside.items() for what, read in each.items()
        )
        target = f"M1 lesions of {SMALLEST_VOXELS} voxels, {name}, least part of their contrast"
        yield Row(target, float(least), VISIBLE, ">=", "", "; ".join(facts))
    yield Row("M1 in space", None, IN_SPACE, "<=", "of range", NO_SPACE)


def scanned(context: BenchmarkContext, asked: SliceWaves, dataset: Dataset) -> Scanned:
    """The images of a slice from its traces; all ways start from the same picks."""
    picked = replace(pick(dataset), waveform=dataset.waveform)
    images = Images.here(picked, context.progress, f"z = {1e3 * asked.z_m:.0f} mm")
    results = {name: images.made(settings).result for name, settings in SETTINGS.items()}
    results[STRAIGHT_RAYS] = images.straight(results[DEFAULT_SETTINGS])
    speeds = {name: on_phantom_nodes(image, asked.coupling_mps) for name, image in results.items()}
    return Scanned(asked, speeds, results[WAVEFORM].provenance["waveform"])


def errors(name: str, slices: Sequence[Scanned]) -> Iterator[Row]:
    """Errors over some slices together, of waveforms and of the default settings, in two regions."""
    asked = slices[0].asked
    size = (
        f"{NODES}², {asked.elements} transducers, {asked.emissions} emit, {1e-3 * asked.frequency_hz:.0f} kHz"
    )
    where = ", ".join(scan.section for scan in slices)
    for region, whole in (("whole image", True), ("inside", False)):
        over = Slices([scan.asked.phantom for scan in slices], whole)
        errors = {way: over.error([scan.speeds[way] for scan in slices]) for way in slices[0].speeds}
        baselines = over.constants() | {way: errors[way] for way in (STRAIGHT_RAYS, DEFAULT_SETTINGS)}
        for way in SETTINGS:
            detail = f"{where}; {size}, water {asked.coupling_mps:g} m/s"
            if way == WAVEFORM:
                detail += "; " + "; ".join(scan.summary for scan in slices)
            target = f"M1 {name}, {way}, {region}"
            yield Row(target, errors[way], BY_SLICES, "<=", "of range", detail, baselines=baselines)


def drawn(clean: Sequence[Scanned], noisy: Sequence[Scanned]) -> bytes:
    """The phantom and the images of each slice, side by side, those with noise last."""
    panels = []
    named = [(scan.section, scan) for scan in clean]
    named += [(f"{scan.section}, SNR {SNR:g}", scan) for scan in noisy]
    for name, scan in named:
        over = Slices([scan.asked.phantom])
        panels.append(Panel(name, scan.asked.phantom.speed(NODES, TABLE7_SIDE_M)))
        panels += [
            Panel(f"{way}\n{over.error([speed]):.4f}", speed)
            for way, speed in ((way, scan.speeds[way]) for way in (STRAIGHT_RAYS, *SETTINGS))
        ]
    title = "3-D breast phantom (Li 2008, Table 7), scanned by waves: rms error over the range"
    return picture(title, panels, 4, TABLE7_SIDE_M)
