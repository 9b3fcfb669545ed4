"""R8 on wave-equation data: attenuation by full-waveform inversion and from amplitudes along rays."""

from collections.abc import Iterable
from dataclasses import replace

from bentray_kernels.acquisition import Dataset, pick
from bentray_kernels.tomography import Settings
from bentray_service.cli.output.benchmark_context import BenchmarkContext
from bentray_service.cli.output.benchmark_row import CONSTANTS, STRAIGHT_RAYS, Row
from bentray_service.cli.output.terminal import Step
from bentray_workers.simulation.waves import WaveSimulationSettings

from ..shared._baselines import Images
from ..shared._image_error import object_attenuation_error
from ..shared._recorded_scans import other_scan
from ._lossy_scan import lossy_scan

# The scan of this frequency is used for its spectra; FWI over so many wavelengths would take minutes.
FINE_HZ = 1e6

# Goal of R8. An image that does not beat constants and straight rays is called experimental.
GOAL = 0.3

AMPLITUDES: dict[str, dict[str, object]] = {
    "ratios": {"amplitudes": "ratio"},
    "ratios, corrected for focusing": {"amplitudes": "ratio", "focusing": True},
    "spectra": {"amplitudes": "spectrum"},
}


def rows(context: BenchmarkContext) -> Iterable[Row]:
    """NRMSE inside the object by FWI and by rays, relative to the true range; quick: only of a small scan."""
    for name, dataset in scans(context.quick, context.progress):
        picked = replace(pick(dataset), waveform=dataset.waveform)
        images = Images.here(picked, context.progress)
        error_on = object_attenuation_error(dataset)
        ways = {
            f"{rays} rays, {way}": Settings.from_values(method="sart", rays=rays, **changes)
            for rays in ("straight", "curved")
            for way, changes in AMPLITUDES.items()
        }
        if dataset.center_frequency_hz != FINE_HZ:
            ways["waveforms"] = Settings(method="waveform")
        made = {way: images.made(settings) for way, settings in ways.items()}
        errors = {way: error_on(image).of(image) for way, (image, _) in made.items()}
        # FWI has no straight rays of its own: it is compared with the best of them, chosen by the truth.
        best = min((way for way in errors if way.startswith("straight")), key=lambda way: errors[way])
        for way, (image, seconds) in made.items():
            straight = made[best].result if way == "waveforms" else None
            compared = images.compared(image, error_on, straight=straight)
            baselines = [*CONSTANTS, *([] if way.startswith("straight") else [STRAIGHT_RAYS])]
            worse = any(compared.error >= compared.baselines[name] for name in baselines)
            detail = f"{image.speed.shape[0]}² nodes, {seconds:.0f} s"
            detail += "; experimental: worse than a constant or straight rays" if worse else ""
            yield compared.row(f"R8 waves, {name}, {way}", compared.error, GOAL, "<=", "of range", detail)


def scans(quick: bool, progress: Step) -> Iterable[tuple[str, Dataset]]:
    """Names and scans with loss, constant or proportional to the frequency."""
    small, usual, fine = (3e5, 0.05, 32, 16, 64), (4e5, 0.08, 64, 32, 128), (FINE_HZ, 0.08, 128, 64, 256)
    asked = [(small, False)] if quick else [(usual, False), (usual, True), (fine, True)]
    for (frequency, side, elements, emissions, nodes), proportional in asked:
        scan = WaveSimulationSettings(frequency, side, elements, emissions, nodes=nodes)
        name = f"simulated {1e-3 * frequency:.0f} kHz{', loss as the frequency' if proportional else ''}"
        yield name, lossy_scan(scan, progress, proportional=proportional)
    if not quick:
        yield from other_scan()
