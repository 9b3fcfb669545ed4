"""Views of a stored scan for a person: geometry, traces of one emission with their picks, and a thumbnail."""

import base64
import math
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np

from bentray_kernels.acquisition import Dataset
from bentray_kernels.acquisition.picking.first_arrivals import read_times, screen_times
from bentray_kernels.acquisition.quality.water_speed import stated_water
from bentray_kernels.arrays import Floats
from bentray_kernels.errors import InvalidInput
from bentray_kernels.requests.names import DEFAULT_PICKER

from ..files.dataset.scan import measured_frequency, open_slice, read_header
from ..files.dataset.units import propose
from ..images.png import png_of

# Elements of a drawing, and receivers and samples of the traces of a view; of more, every n-th is taken.
MAX_ELEMENTS, MAX_RECEIVERS, MAX_SAMPLES = 4096, 512, 1024
# Sides of a thumbnail, pixels, and the grey of pairs without a travel time.
THUMBNAIL_PX, MISSING = 96, 230.0


def scan_geometry(path: Path, *, water_temperature_c: float | None = None) -> dict[str, Any]:
    """Task: elements, acquisition and water of a dataset file, as JSON values.

    Args:
        path: of the dataset file.
        water_temperature_c: in place of that of the file, °C.

    Raises:
        InvalidInput: as ``read_dataset``.
    """
    # Also of a scan that an earlier version took, and that the checks of today would refuse.
    header = read_header(path, plausible=False, estimate=False)
    recorded = header.dataset
    scan = recorded.in_water_of(water_temperature_c)
    measured = measured_frequency(path)
    frequency = scan.center_frequency_hz or measured
    every = max(1, math.ceil(len(scan.element_position_m) / MAX_ELEMENTS))
    shown = np.arange(0, len(scan.element_position_m), every)
    same = int((scan.tx[:, None] == scan.rx[None, :]).sum())
    pairs = scan.slices * (len(scan.tx) * len(scan.rx) - same)
    return {
        "array_type": scan.array_type,
        "radius_m": scan.radius_m,
        "every": every,
        "position_m": scan.element_position_m[shown].tolist(),
        "emits": np.isin(shown, scan.tx).tolist(),
        "receives": np.isin(shown, scan.rx).tolist(),
        "slice_z_m": [] if scan.slice_z_m is None else scan.slice_z_m.tolist(),
        "center_frequency_hz": frequency,
        "frequency_estimated": frequency is not None and scan.center_frequency_hz is None,
        "sampling_rate_hz": scan.sampling_rate_hz,
        "t0_s": scan.t0_s,
        "samples": header.samples,
        "water_shot": header.samples > 0 and not header.lacks_water,
        "water_speed_mps": scan.water_speed_mps,
        "water_temperature_c": scan.water_temperature_c,
        "water_assumed": scan.water_temperature_assumed,
        "water_in_file": stated_water(recorded),
        "pairs": pairs,
        "timed_pairs": int(np.isfinite(scan.differential_tof()).sum()) if scan.picked else None,
        "impossible_times": dict(recorded.impossible_times),
        "proposed_corrections": [asdict(correction) for correction in propose(recorded, measured)],
    }


def emission_traces(
    path: Path, *, emission: int, index: int, what: str, water_temperature_c: float | None = None
) -> dict[str, Any]:
    """Task: the traces of one emission, reduced to a size for a screen, and the arrival times.

    Of several samples that fall on one, the one with the largest magnitude is kept, so that no peak is lost.

    Args:
        path: of the dataset file.
        emission: index into ``acquisition/tx``.
        index: of the slice.
        what: ``object`` or ``water``.
        water_temperature_c: in place of that of the file, °C.

    Returns:
        JSON values: ``traces`` is base64 of float32, little endian, (receivers, samples), each trace divided
        by its peak. ``straight_s`` and ``pick_s``: arrivals in water, and with the object; None without.

    Raises:
        InvalidInput: naming ``emission``, ``slice`` or ``quantity``; as ``read_dataset``.
    """
    header = read_header(path, estimate=False)
    scan = header.dataset.in_water_of(water_temperature_c)
    for name, value, count in (("emission", emission, len(scan.tx)), ("slice", index, scan.slices)):
        if not 0 <= value < count:
            raise InvalidInput(name, value, f"0 to {count - 1}")
    # The picker alone needs it; its estimate reads traces of other emissions too.
    frequency = (
        None if scan.picked or header.lacks_water else scan.center_frequency_hz or measured_frequency(path)
    )
    with open_slice(path, scan, index) as dataset:
        traces = None if dataset.waveform is None else getattr(dataset.waveform, what)
        if traces is None or dataset.sampling_rate_hz is None:
            given = f"{what!r}, of which the scan has no traces"
            raise InvalidInput("quantity", given, "object or water, whichever the scan has; see the geometry")
        shot = np.asarray(traces[emission], dtype=np.float32)
        picks, picker = _picks(replace(dataset, center_frequency_hz=frequency), emission)
        rate, first = dataset.sampling_rate_hz, dataset.t0_s
    straight = scan.distance_m()[emission] / scan.water_speed_mps
    every = max(1, math.ceil(shot.shape[0] / MAX_RECEIVERS))
    block = max(1, math.ceil(shot.shape[1] / MAX_SAMPLES))
    receivers = np.arange(0, shot.shape[0], every)
    reduced = _reduced(shot[receivers], block)
    return {
        "emission": emission,
        "element": int(scan.tx[emission]),
        "slice": index,
        "quantity": what,
        "receiver_element": scan.rx[receivers].tolist(),
        "receivers": len(receivers),
        "samples": reduced.shape[1],
        "first_s": first,
        # A sample stands for a block that begins at it.
        "step_s": block / rate,
        "traces": base64.b64encode(reduced.astype("<f4").tobytes()).decode(),
        "straight_s": straight[receivers].tolist(),
        "pick_s": None if picks is None else _numbers((straight + picks)[receivers]),
        "picker": picker,
    }


def scan_thumbnail(path: Path) -> bytes:
    """Task: a small grey picture of the first slice of a scan, as PNG.

    Travel-time differences, emitters down and receivers across; without these the magnitude of the
    traces of the first emission, time down and receivers across.

    Args:
        path: of the dataset file.

    Raises:
        InvalidInput: as ``read_dataset``.
    """
    scan = read_header(path, plausible=False, estimate=False).dataset
    with open_slice(path, scan, 0) as dataset:
        if dataset.waveform is None or dataset.picked:
            image = dataset.differential_tof()
        else:
            shot = np.asarray(dataset.waveform.object[0], dtype=np.float32)
            image = np.abs(_reduced(shot, max(1, shot.shape[1] // THUMBNAIL_PX))).T
    image = image[np.ix_(*(np.linspace(0, n - 1, THUMBNAIL_PX).round().astype(int) for n in image.shape))]
    known = np.isfinite(image)
    low, high = np.percentile(image[known], (1.0, 99.0)) if known.any() else (0.0, 1.0)
    grey = 255.0 * np.clip((image - low) / ((high - low) or 1.0), 0.0, 1.0)
    return png_of(np.repeat(np.where(known, grey, MISSING).astype(np.uint8)[..., None], 3, axis=2))


def _picks(dataset: Dataset, emission: int) -> tuple[Floats | None, str]:
    """Object minus water of each receiver, s, NaN without; and the picker, empty for times of the file."""
    if dataset.picked:
        return dataset.differential_tof()[emission], dataset.picker
    if dataset.waveform is None or dataset.waveform.water is None or dataset.center_frequency_hz is None:
        return None, ""
    shape = len(dataset.tx), len(dataset.rx)
    delta, _ = read_times(dataset, [emission], DEFAULT_PICKER)
    whole = np.full(shape, np.nan)
    whole[emission] = delta[0]
    # Without the comparison with neighbouring emissions, which would read all traces.
    return screen_times(dataset, whole, np.zeros(shape), screened=False)[0][emission], DEFAULT_PICKER


def _reduced(shot: Any, block: int) -> Any:
    """(receivers, samples): traces without offset, of each block the sample with the largest magnitude."""
    shot = np.where(np.isfinite(shot), shot, 0.0)
    shot = shot - np.median(shot, axis=1, keepdims=True)
    peak = np.abs(shot).max(axis=1, keepdims=True)
    shot = np.divide(shot, peak, out=np.zeros_like(shot), where=peak > 0.0)
    whole = -(-shot.shape[1] // block) * block
    blocks = np.pad(shot, ((0, 0), (0, whole - shot.shape[1]))).reshape(len(shot), -1, block)
    largest = np.abs(blocks).argmax(axis=2)
    return np.take_along_axis(blocks, largest[..., None], axis=2)[..., 0]


def _numbers(values: Floats) -> list[float | None]:
    return [float(value) if math.isfinite(value) else None for value in values]
