"""A4, Figure 33: attenuation of slices of Table 7 by default settings, and what limits it."""

from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from os import cpu_count

import numpy as np

from bentray_kernels.acquisition import Dataset, pick
from bentray_kernels.acquisition.noise import with_noise
from bentray_kernels.acquisition.picking.amplitudes import with_log_ratios
from bentray_kernels.arrays import Flags, Floats
from bentray_kernels.phantoms import TABLE7_FREQUENCY_HZ
from bentray_kernels.tomography import Reconstruction, Settings
from bentray_kernels.tomography.attenuation import active_emitters, solve, trace_rays
from bentray_kernels.tomography.gauss_newton.linearisation import Rows
from bentray_kernels.tomography.problem import Problem
from bentray_kernels.tomography.scan import MemorySource, Scan
from bentray_kernels.tomography.stage_graphs import batches_of
from bentray_service.cli.output.benchmark_context import BenchmarkContext
from bentray_service.cli.output.benchmark_row import BEST_CONSTANT, Row

from ..acquisition._lossy_scan import lossy_scan
from ..shared._baselines import Images
from ..shared._image_error import ImageError
from ._phantom_scan import PhantomScan
from ._table7_slices import NODES, Skin, SliceWaves
from .chapter7_readings import FREQUENCY_HZ, Data, scanned, silent

# Theirs, of the whole image; and ours, of the error of the best constant.
GOAL, OF_CONSTANT = 0.075, 0.6
COUPLINGS_MPS, SKINS, SNR = (1375.0, 1500.0), ("skin", "no skin"), 10.0

# A quarter of the published number; with half of it errors in the breast were 0.01 less, with the skin 0.06.
ELEMENTS = 64

# On so many times the nodes the skin has eight, and rays are nearly those of the data.
FINER = 4

# What was made ideal for an image, and the image.
Rungs = Iterable[tuple[str, Reconstruction]]


def rows(context: BenchmarkContext) -> Iterable[Row]:
    """Errors on line integrals and on waves, with and without skin, in two regions and by two goals."""
    nodes, elements = (48, 24) if context.quick else (NODES, ELEMENTS)
    cases: list[tuple[float, Skin]] = [(speed, skin) for speed in COUPLINGS_MPS for skin in SKINS]
    for done, (coupling, skin) in enumerate(cases):
        name = f"{skin}, coupling {coupling:g}"
        context.progress(done, len(cases), name)
        scan = scanned(Data(skin, coupling), nodes, elements, losses=True)
        yield from ladder(f"line integrals, {name}", scan, scan.images, of_line_integrals(scan))
        asked = SliceWaves(
            FREQUENCY_HZ, elements=elements, emissions=elements // 2, coupling_mps=coupling, skin=skin
        )
        traces = lossy_scan(asked, silent, proportional=False, reference_hz=TABLE7_FREQUENCY_HZ)
        picked = replace(pick(traces), waveform=traces.waveform)
        waves = replace(scan, dataset=replace(with_log_ratios(picked, "ratio"), waveform=None))
        images = Images.here(waves.dataset, silent, default=Settings.from_values(amplitudes="ratio"))
        scale = FREQUENCY_HZ / TABLE7_FREQUENCY_HZ
        yield from ladder(f"waves, {name}", waves, images, of_waves(waves, images), scale)


def ladder(name: str, scan: PhantomScan, images: Images, rungs: Rungs, scale: float = 1.0) -> Iterator[Row]:
    """Rows of the image by default settings, then of the rungs; ``scale``: of the phantom's attenuation."""

    def breast(image: Reconstruction) -> ImageError:
        error = scan.attenuation_rms(image)
        return replace(error, true=scale * error.true, unit=scale * error.unit)

    def whole(image: Reconstruction) -> ImageError:
        return replace(breast(image), region=np.ones(image.speed.shape, dtype=bool))

    default = images.default().result
    straight = images.straight(default)
    size = f"{scan.scan.ring.elements} elements"
    for ideal, image in (("", default), *rungs):
        nodes = f"{image.speed.shape[0]}² nodes, {size}"
        errors = {
            region: images.compared(image, error_on, straight=straight)
            for region, error_on in (("whole image", whole), ("breast", breast))
        }
        parts = {region: each.error / each.baselines[BEST_CONSTANT] for region, each in errors.items()}
        if ideal:
            each = errors["breast"]
            detail = f"breast, {parts['breast']:.2f} of the best constant; whole image "
            detail += f"{errors['whole image'].error:.3f}; {nodes}"
            yield each.row(f"A4 {name}, {ideal}", each.error, GOAL, "<=", "of range", detail)
            continue
        held_out = image.caution("attenuation") or image.provenance["attenuation"].split("; ")[-1]
        detail = f"{image.settings.rays} {image.settings.method}, {nodes}; {held_out}"
        for region, each in errors.items():
            yield each.row(f"A4 {name}, {region}", each.error, GOAL, "<=", "of range", detail)
            target = f"A4 {name}, {region}, over the best constant"
            yield each.row(target, parts[region], OF_CONSTANT, "<=", "", detail)


def of_line_integrals(scan: PhantomScan) -> Rungs:
    """Each part of the problem ideal, or changed, by itself."""
    default, data = scan.images.default().result, scan.dataset
    settings, truth = default.settings, scan.scan.phantom
    nodes, side = default.speed.shape[0], default.spacing_m[0] * (default.speed.shape[0] - 1)
    bent = settings.changed(method="gauss-newton", rays="curved", ray_width_m=0.0)
    fine = bent.changed(nodes=FINER * nodes, side_m=side)
    speed, inside = truth.speed(nodes, side), truth.inside(nodes, side)
    yield "true speed", solved(default, data, bent, speed)
    yield (
        f"true speed on {FINER} times the nodes",
        solved(default, data, fine, truth.speed(FINER * nodes, side)),
    )
    yield "breast known", solved(default, data, settings, default.speed, inside)
    yield "a tenth of the penalty", solved(default, data, weighted(settings, 0.1), default.speed)
    yield "ten times the penalty", solved(default, data, weighted(settings, 10.0), default.speed)
    assert data.log_ratio_np is not None
    noisy, _ = with_noise(data.log_ratio_np, SNR, np.random.default_rng(0), data.tx[:, None] != data.rx)
    yield f"SNR {SNR:g}", solved(default, replace(data, log_ratio_np=noisy), settings, default.speed)
    straight = fine.changed(rays="straight")
    problem, rays = traced(data, straight, np.ones((FINER * nodes,) * 2))
    loss = truth.attenuation(FINER * nodes, side) * problem.spacing
    integrals = np.full(data.log_ratio_np.shape, np.nan)
    integrals[np.isfinite(problem.log_ratio)] = np.concatenate([part.project(loss) for part in rays])
    plain = settings.changed(method="gauss-newton", rays="straight", ray_width_m=0.0)
    yield "nothing bends", solved(default, replace(data, log_ratio_np=integrals), plain, speed)


def of_waves(scan: PhantomScan, images: Images) -> Rungs:
    """True rays, and amplitudes corrected for focusing, by themselves and together."""
    default = images.default().result
    nodes, side = default.speed.shape[0], default.spacing_m[0] * (default.speed.shape[0] - 1)
    speed = scan.scan.phantom.speed(nodes, side)
    focused = default.settings.changed(focusing=True)
    yield "true speed", solved(default, scan.dataset, default.settings, speed)
    yield "corrected for focusing", solved(default, scan.dataset, focused, default.speed)
    yield "corrected for focusing in the true speed", solved(default, scan.dataset, focused, speed)


def weighted(settings: Settings, factor: float) -> Settings:
    """Settings with another penalty."""
    return settings.changed(penalty_strength=factor * settings.gauss_newton.penalty_strength)


def traced(dataset: Dataset, settings: Settings, speed: Floats) -> tuple[Problem, list[Rows]]:
    """The problem of a scan, and its rays through an image."""
    problem = Scan(MemorySource(dataset), settings).problem(0)
    with ThreadPoolExecutor(cpu_count()) as pool:
        batches = batches_of(active_emitters(problem))
        return problem, list(pool.map(lambda part: trace_rays(problem, settings, 1.0 / speed, part), batches))


def solved(
    like: Reconstruction, dataset: Dataset, settings: Settings, speed: Floats, region: Flags | None = None
) -> Reconstruction:
    """An image like another with its attenuation along rays through a speed; ``region``: that may change."""
    problem, rays = traced(dataset, settings, speed)
    if region is not None:
        problem = replace(problem, region=problem.region & region)
    loss = solve(problem, settings, rays)
    return replace(like, speed=speed, attenuation=loss, spacing_m=(problem.spacing,) * 2)
