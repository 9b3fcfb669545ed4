"""U1 and U2: the standard deviations of nodes hold on simulated scans, their score and their time."""

import math
import os
import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

import numpy as np
from scipy.ndimage import gaussian_filter

from bentray_kernels.acquisition import Dataset
from bentray_kernels.tomography import Reconstruction, Settings, reconstruct
from bentray_kernels.tomography.gauss_newton.gauss_newton_step import trace_rays
from bentray_kernels.tomography.problem import MARGIN_NODES, Problem
from bentray_kernels.tomography.stage_graphs import batches_of
from bentray_kernels.tomography.uncertainty.ray_uncertainty import ray_uncertainty
from bentray_service.cli.output.benchmark_context import BenchmarkContext
from bentray_service.cli.output.benchmark_row import Row
from bentray_workers.simulation.simulation_run import simulate
from bentray_workers.simulation.volume import VolumeSimulationSettings

from ..reconstruction.reconstruction_volume import COUPLING_MPS
from ._breast_scans import SEED, BreastScan, breast_scans
from ._calibration_picture import calibration_picture
from ._judged_image import DEVIATIONS, Judged, correlation, part_within, rms, row_of, sizes
from ._proper_score import score_rows
from .uncertainty_waveform import beside_truth, wave_scans

# None of the scans chose the deviations. One deviation for all nodes is chosen with the first half of the
# scans, so that nine tenths of their nodes lie within two, and is compared on the others.
SCANS, QUICK_SCANS = 20, 2
PART, CHOSEN_PART = 0.85, 0.9

# Scans of the score; no other seed is theirs.
SCORE_SEED = 20261128
CHOSEN_ON = "settings chosen on 36 scans of seeds 501, 503 and 504"

# Other breasts, all in water that is slower than skin and glands and hardly faster than fat.
SLOW_SCANS, SLOW_SEED, SLOW_MPS = 6, 89, 1440.0

# Waves whose times are picked.
WAVE_SCANS, WAVE_HZ = 2, 3e5

# A small volume in 3-D.
NODES, SLICES, ELEMENTS, SNR = 24, 6, 24, 30.0

# A node whose true speed differs from that of the coupling by more than this is in the object, m/s.
DIFFERENT_MPS = 1.0


def rows(context: BenchmarkContext) -> Iterable[Row]:
    """Rows of the calibration, then of the time."""
    count = QUICK_SCANS if context.quick else SCANS
    judged = list(judged_scans(context, count, SEED))
    chosen_with, others = judged[: count // 2], judged[count // 2 :]
    constant = constant_deviation(chosen_with)
    flat = float(np.mean(np.abs(np.concatenate([x.in_breast[0] for x in others])) <= DEVIATIONS * constant))
    each = "; ".join(f"{image.name}: {100.0 * image.within:.0f} %" for image in judged)
    yield Row(
        "U1 nodes within two deviations, scans that chose nothing",
        part_within(others, DEVIATIONS),
        PART,
        ">=",
        "",
        f"{len(others)} scans, nodes in the breast; one deviation for all nodes, chosen with the other "
        f"{len(chosen_with)}: {100.0 * flat:.0f} %",
    )
    yield Row(
        "U1 nodes within two deviations, all scans",
        part_within(judged, DEVIATIONS),
        PART,
        ">=",
        "",
        f"{len(judged)} scans, {100.0 * part_within(judged, 1.0):.0f} % within one deviation; {each}",
    )
    least = min(judged, key=lambda image: image.within)
    yield Row(
        "U1 nodes within two deviations, the scan with the fewest",
        least.within,
        PART,
        ">=",
        "",
        f"{least.name}; {sizes(*least.in_breast)}",
    )
    yield from cautions(judged)
    correlations = [correlation(image) for image in judged]
    yield Row(
        "U1 rank correlation of deviation and error, least of all scans",
        min(correlations),
        0.2,
        ">=",
        "",
        f"median {float(np.median(correlations)):.2f}; a deviation that is the same at all nodes has 0",
    )
    image, own = (sum(getattr(image, name) for image in judged) for name in ("image_s", "uncertainty_s"))
    yield Row(
        "U1 time of image and uncertainty over that of the image",
        (image + own) / image,
        2.0,
        "<",
        "",
        f"CPU time of {len(judged)} scans, {image:.0f} s for the images; load {os.getloadavg()[0]:.1f}",
    )
    context.save_picture("uncertainty.png", lambda: calibration_picture(judged))
    if not context.quick:
        unseen = list(judged_scans(context, SCANS, SCORE_SEED))
        yield from score_rows(unseen, f"{len(unseen)} scans of seed {SCORE_SEED}, judged once; {CHOSEN_ON}")
        yield from slow_water(context)
        yield picked_times(context)
        yield small_volume(context, PART)


def cautions(judged: Sequence[Judged]) -> Iterable[Row]:
    """Error of the images whose result says that its deviations may be too small, over that of the others."""
    told = [image for image in judged if image.result.caution("uncertainty")]
    rest = [image for image in judged if not image.result.caution("uncertainty")]
    names = ", ".join(image.name.split(":")[0] for image in told)
    shares = [
        f"{100.0 * part_within(group, DEVIATIONS):.0f} %" if group else "none" for group in (told, rest)
    ]
    error = [
        math.sqrt(float(np.mean([rms(x.in_breast[0]) ** 2 for x in group])))
        for group in (told, rest)
        if group
    ]
    yield Row(
        "U1 rms error of images with a caution over that of the others",
        float(error[0] / error[1]) if told and rest else None,
        1.0,
        ">",
        "",
        f"{len(told)} of {len(judged)} images have one: {names or 'none'}; within two deviations "
        f"{shares[0]} of their nodes, {shares[1]} of those of the others",
    )


def slow_water(context: BenchmarkContext) -> Iterable[Row]:
    """Nodes within two deviations in water that is slower than skin and glands; they chose nothing."""
    judged = list(judged_scans(context, SLOW_SCANS, SLOW_SEED, SLOW_MPS))
    least = min(judged, key=lambda image: image.within)
    told = [bool(image.result.caution("uncertainty")) for image in judged]
    each = "; ".join(
        f"{image.name}{', with a caution' if doubted else ''}: {100.0 * image.within:.0f} %"
        for image, doubted in zip(judged, told, strict=True)
    )
    correlations = [correlation(image) for image in judged]
    yield Row(
        f"U1 water of {SLOW_MPS:.0f} m/s, nodes within two deviations, the scan with the fewest",
        least.within,
        PART,
        ">=",
        "",
        f"{len(judged)} other breasts; {sizes(*least.in_breast)}; {each}; rank correlation of deviation and "
        f"error at least {min(correlations):.2f}",
    )


def picked_times(context: BenchmarkContext) -> Row:
    """Nodes within two deviations of images from times that were picked from waves; they chose nothing."""
    errors, deviations, details = [], [], []
    for number, scan in enumerate(wave_scans(WAVE_SCANS, context, WAVE_HZ)):
        result = reconstruct(
            replace(scan, waveform=None), Settings.from_values(uncertainty=True, attenuation=False)
        )
        error, deviation = beside_truth(scan, result)
        errors.append(error)
        deviations.append(deviation)
        rays = "bent" if result.settings.rays == "curved" else "straight"
        within = 100.0 * np.mean(error <= DEVIATIONS * deviation)
        details.append(f"{number}: {rays} {result.settings.method} {within:.0f} %")
    about = f"{len(details)} scans at {1e-3 * WAVE_HZ:.0f} kHz; {'; '.join(details)}"
    error, deviation = np.concatenate(errors), np.concatenate(deviations)
    return row_of("U1 picked wave times", error, deviation, PART, about)


def judged_scans(
    context: BenchmarkContext, count: int, seed: int, water_mps: float | None = None
) -> Iterator[Judged]:
    """Each of some breast scans, judged; see ``breast_scans``."""
    for number, scan in enumerate(breast_scans(count, seed, water_mps)):
        context.progress(number, count, scan.name)
        yield judge(scan)


def judge(scan: BreastScan) -> Judged:
    """Reconstruct a scan by the default settings, and compare with the truth."""
    begun = time.process_time()
    result = reconstruct(scan.dataset, Settings.from_values(uncertainty=True, attenuation=False))
    whole = time.process_time() - begun
    assert result.uncertainty is not None
    spacing, nodes = result.spacing_m[0], result.speed.shape[0]
    side = spacing * (nodes - 1)
    (width,) = result.resolution_width_m
    truth = scan.breast.speed(nodes, side)
    smooth = gaussian_filter(truth, width / spacing, mode="nearest") if width > 0.0 else truth
    known, breast = result.uncertainty > 0.0, scan.breast.inside(nodes, side)
    own = seconds_of_uncertainty(scan.dataset, result)
    settings = result.settings
    name = f"{scan.name}, {'bent' if settings.rays == 'curved' else 'straight'} {settings.method}"
    error = (result.speed - smooth)[known]
    return Judged(name, result, error, result.uncertainty[known], breast[known], whole - own, own)


def seconds_of_uncertainty(dataset: Dataset, result: Reconstruction) -> float:
    """CPU time of the uncertainty of a result, s."""
    begun = time.process_time()
    problem = Problem.from_dataset(dataset, result.settings, 0).each_pair_once()
    slowness = 1.0 / result.speed
    blocks = [
        trace_rays(problem, replace(result.settings, rays="curved"), slowness, batch)
        for batch in batches_of(problem.active_emitters)
    ]
    ray_uncertainty(problem, result.settings, slowness, blocks)
    return time.process_time() - begun


def constant_deviation(judged: Sequence[Judged]) -> float:
    """One deviation for all nodes with ``CHOSEN_PART`` of them within ``DEVIATIONS``, m/s."""
    errors = np.abs(np.concatenate([image.in_breast[0] for image in judged]))
    return float(np.quantile(errors, CHOSEN_PART)) / DEVIATIONS


def small_volume(context: BenchmarkContext, goal: float) -> Row:
    """Nodes of the phantom of Table 7 within two deviations; it chose nothing."""
    asked = VolumeSimulationSettings(
        NODES, SLICES, ELEMENTS, COUPLING_MPS, refinement=2, three_d=True, array="moved", snr=SNR
    )
    with context.cluster() as cluster:
        scan = simulate(
            asked, lambda p: context.progress(p.done, p.total, "simulating in space"), cluster.client
        )
    truth = scan.truth
    assert truth is not None
    settings = Settings.from_values(
        method="gauss-newton",
        decomposition="volume",
        nodes=NODES,
        side_m=asked.scan().side_m,
        uncertainty=True,
        attenuation=False,
    )
    result = reconstruct(scan, settings)
    assert result.uncertainty is not None
    inner = slice(MARGIN_NODES, MARGIN_NODES + SLICES)
    deviation = result.uncertainty[..., inner]
    width = result.resolution_width_m[0] / result.spacing_m[0]
    smooth = gaussian_filter(truth.sound_speed_mps, width, mode="nearest")
    inside = (np.abs(truth.sound_speed_mps - COUPLING_MPS) > DIFFERENT_MPS) & (deviation > 0.0)
    error, deviation = np.abs(result.speed[..., inner] - smooth)[inside], deviation[inside]
    about = f"{NODES}² by {SLICES} nodes, {ELEMENTS} elements at each height, SNR {SNR:g}"
    return row_of("U1 small volume in 3-D", error, deviation, goal, about)
