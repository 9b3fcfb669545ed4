"""F1: reflection through bent rays: place, width and contrast of targets behind fat, and time."""

import os
import time
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np

from bentray_kernels.acquisition import Dataset, pick
from bentray_kernels.tomography import Reconstruction, Settings, reconstruct
from bentray_kernels.tomography.reflection.delay_and_sum import PAIR_ANGLE_DEG, Pixels, Signals, sum_echoes
from bentray_kernels.tomography.reflection.element_times import joined, solve_times
from bentray_kernels.tomography.result import Reflection
from bentray_service.cli.output.benchmark_context import BenchmarkContext
from bentray_service.cli.output.benchmark_row import Row

from ..waves._kwave_peer import installed
from ._echo_measures import Echo, cyst_contrast, echo_near, line_offset
from ._fat_scan import CYST, CYST_M, LINE, POINTS, FatScan
from ._reflection_picture import picture

SIZE, QUICK = FatScan(), FatScan(3e5, 64, 16)

# The scan by k-Wave: half the frequency, so that it takes minutes; around a target, wavelengths.
OTHER_HZ, OTHER_ELEMENTS, OTHER_EMISSIONS, OTHER_WINDOW = 5e5, 128, 16, 1.4

# Around a target, wavelengths: water moves it by two, and the next one is farther away.
WINDOW_WAVES = 3.2

# Images by the speed that delays are computed in; the last is of the same targets in water.
RECONSTRUCTED, WATER, REFERENCE = "reconstructed speed", "water", "no fat"

# Of the measured time: elements, pixels along a side, nodes of the speed, samples of a signal.
ELEMENTS, PIXELS, NODES, SAMPLES = 256, 512, 128, 3600
BATCH, SIDE_M, WATER_MPS = 16, 0.2, 1500.0


def rows(context: BenchmarkContext) -> Iterable[Row]:
    """Rows of the targets, then of the time."""
    size = QUICK if context.quick else SIZE
    scans = size.simulated(context.progress)
    images, speed = reflections(scans, context)
    yield from compared(size, images, speed)
    context.save_picture("reflection.png", lambda: picture(size, images, speed))
    yield from other_solver(context)
    yield from timed(context)


def reflections(
    scans: dict[str, Dataset], context: BenchmarkContext
) -> tuple[dict[str, Reflection], Reconstruction]:
    """Images of the scans, and the reconstruction of the one behind fat, all by the default settings."""
    images, result = {}, None
    wanted = Settings.from_values(reflection=True, attenuation=False)
    # The speed of the image in water is not used.
    plain = wanted.changed(method="sart", iterations=1, delays="water", nodes=64)
    for name, scan, settings in (
        (RECONSTRUCTED, scans["behind fat"], wanted),
        (WATER, scans["behind fat"], plain),
        (REFERENCE, scans["in water"], plain),
    ):
        picked = replace(pick(scan), waveform=scan.waveform)
        made = reconstruct(
            picked, settings, lambda p, name=name: context.progress(p.done, p.total, f"delays: {name}")
        )
        assert made.reflection is not None
        images[name] = made.reflection
        result = result or made
    assert result is not None
    return images, result


def compared(size: FatScan, images: dict[str, Reflection], speed: Reconstruction) -> Iterator[Row]:
    """Places, widths and contrast with delays in the reconstructed speed, beside those of water."""
    wave = size.wavelength_m
    found: dict[str, list[Echo]] = {
        name: [echo_near(image, point, WINDOW_WAVES * wave) for point in POINTS]
        for name, image in images.items()
    }
    moved = {name: [echo.away_m / wave for echo in echoes] for name, echoes in found.items()}
    each = "; ".join(f"{name}: " + ", ".join(f"{one:.2f}" for one in away) for name, away in moved.items())
    made = f"{size.elements} elements, {size.emissions} emit, {1e-6 * size.frequency_hz:g} MHz; "
    made += f"speed by {speed.settings.rays} {speed.settings.method}, {speed.speed.shape[0]} nodes; "
    yield Row(
        "F1 points behind fat, largest error of place",
        max(moved[RECONSTRUCTED]),
        0.5,
        "<=",
        "wavelengths",
        made + each,
    )
    yield Row(
        "F1 points behind fat, least error with delays in water",
        min(moved[WATER]),
        2.0,
        ">=",
        "wavelengths",
        each,
    )
    lines = {name: line_offset(image, LINE, WINDOW_WAVES * wave) / wave for name, image in images.items()}
    beside = "; ".join(f"{name}: {error:.2f}" for name, error in lines.items())
    yield Row("F1 line behind fat, error of place", lines[RECONSTRUCTED], 0.5, "<=", "wavelengths", beside)
    widths = {name: float(np.mean([one.width_m for one in echoes])) / wave for name, echoes in found.items()}
    beside = "; ".join(f"{name}: {width:.2f} wavelengths" for name, width in widths.items())
    yield Row(
        "F1 points behind fat, -6 dB width over that without fat",
        widths[RECONSTRUCTED] / widths[REFERENCE],
        1.3,
        "<=",
        "",
        beside,
    )
    contrasts = {name: cyst_contrast(image, CYST, CYST_M) for name, image in images.items()}
    beside = "; ".join(f"{name}: {value:.2f}" for name, value in contrasts.items())
    yield Row(
        "F1 cyst behind fat, contrast over that with delays in water",
        contrasts[RECONSTRUCTED] / contrasts[WATER],
        1.5,
        ">=",
        "",
        beside,
    )


def other_solver(context: BenchmarkContext) -> Iterator[Row]:
    """Places of the targets in a scan by k-Wave, where it is installed."""
    peers, why = installed()
    targets = (
        "F1 k-Wave, points behind fat, largest error of place",
        "F1 k-Wave, line behind fat, error of place",
    )
    if context.quick:
        return
    if not peers:
        for target in targets:
            yield Row(target, None, 0.5, "<=", "wavelengths", why["k-Wave"])
        return
    size = FatScan(OTHER_HZ, OTHER_ELEMENTS, OTHER_EMISSIONS, peers["k-Wave"])
    scan = size.simulated(context.progress, ("behind fat",))["behind fat"]
    picked = replace(pick(scan), waveform=scan.waveform)
    wanted, wave = Settings.from_values(reflection=True, attenuation=False), size.wavelength_m
    images = {
        delays: reconstruct(picked, wanted.changed(delays=delays)).reflection
        for delays in ("reconstructed", "water")
    }
    moved, lines = {}, {}
    for delays, image in images.items():
        assert image is not None
        echoes = [echo_near(image, point, OTHER_WINDOW * wave) for point in POINTS]
        moved[delays] = [echo.away_m / wave for echo in echoes]
        lines[delays] = line_offset(image, LINE, OTHER_WINDOW * wave) / wave
    made = f"{size.elements} elements, {size.emissions} emit, {1e-6 * size.frequency_hz:g} MHz; "
    each = "; ".join(f"{name}: " + ", ".join(f"{one:.2f}" for one in away) for name, away in moved.items())
    yield Row(targets[0], max(moved["reconstructed"]), 0.5, "<=", "wavelengths", made + each)
    each = "; ".join(f"{name}: {error:.2f}" for name, error in lines.items())
    yield Row(targets[1], lines["reconstructed"], 0.5, "<=", "wavelengths", made + each)


def timed(context: BenchmarkContext) -> Iterator[Row]:
    """Delay and sum of 256 x 256 pairs at 512 x 512 pixels by two threads, travel times included."""
    turn = 2.0 * np.pi * np.arange(ELEMENTS) / ELEMENTS
    spacing, middle = 1.1 * SIDE_M / (NODES - 1), 0.55 * SIDE_M
    ring = 0.5 * SIDE_M * np.column_stack((np.cos(turn), np.sin(turn))) + middle
    step = SIDE_M / PIXELS
    line = step * (np.arange(PIXELS) + 0.5) - 0.5 * SIDE_M
    inside = np.hypot(line[:, None], line[None, :]) < 0.49 * SIDE_M
    pixels = Pixels(np.full(2, middle + line[0]) / spacing, step / spacing, inside)
    everyone = np.arange(ELEMENTS)
    samples = np.random.default_rng(1).standard_normal((BATCH, ELEMENTS, 2, SAMPLES)).astype(np.float32)
    used = np.ones((BATCH, ELEMENTS), dtype=bool)
    # A sample of each record beyond the longest way.
    signals = Signals(samples, used, 0.0, 0.9 * SAMPLES * WATER_MPS / (2.2 * SIDE_M))
    speed = np.full((NODES, NODES), WATER_MPS)
    batches = range(0, ELEMENTS // (8 if context.quick else 1), BATCH)

    def solve(begin: int) -> object:
        return solve_times(speed, spacing, ring[begin : begin + BATCH])

    def total(begin: int) -> object:
        context.progress(begin, ELEMENTS, "pairs")
        emitters = everyone[begin : begin + BATCH]
        return sum_echoes(signals, times, spacing, emitters, everyone, pixels, PAIR_ANGLE_DEG)

    with ThreadPoolExecutor(2) as pool:
        begun, cpu = time.perf_counter(), time.process_time()
        times = joined(list(pool.map(solve, range(0, ELEMENTS, BATCH))))
        list(pool.map(total, batches))
        seconds, cpu = time.perf_counter() - begun, time.process_time() - cpu
    emitters = len(batches) * BATCH
    detail = f"{emitters} x {ELEMENTS} pairs, {int(inside.sum())} of {PIXELS}² pixels lie in the ring; "
    detail += f"two threads, {cpu:.1f} s of processor time; signals of noise; "
    detail += f"load {os.getloadavg()[0]:.1f}"
    yield Row(f"F1 time, {emitters} x 256 pairs x 512²", seconds, 60.0, "<=", "s", detail)
