"""Application of findings to a dataset: corrections, and masks of pairs left out."""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from ...arrays import Flags, Ints
from ..dataset import OVER_PAIRS, Dataset
from ..emissions import invert_polarity, reorder_channels
from ..waveform import ARRAYS, Waveform
from .finding import Finding
from .time_zero import OBJECT, RECORDING
from .water_speed import WATER_SPEED


def apply(dataset: Dataset, findings: Iterable[Finding]) -> Dataset:
    """One slice with findings applied, in their order."""
    for finding in findings:
        if finding.action == "corrected":
            dataset = _corrected(dataset, finding)
        elif finding.action == "left out" and finding.pairs is not None:
            valid = np.ones(finding.pairs.shape, dtype=bool) if dataset.valid is None else dataset.valid
            dataset = replace(dataset, valid=valid & ~finding.pairs)
    return dataset


def stacked(dataset: Dataset, slices: list[Dataset]) -> Dataset:
    """Combine the slices of a dataset."""

    def several(name: str) -> np.ndarray | None:
        arrays = [getattr(slice_data, name) for slice_data in slices]
        if all(array is None for array in arrays):
            return None
        # Slices without findings have no mask.
        shape = next(array.shape for array in arrays if array is not None)
        return np.stack([np.ones(shape, dtype=bool) if array is None else array for array in arrays])

    waveform = None
    if dataset.waveform is not None and all(slice_data.waveform is not None for slice_data in slices):
        held = [slice_data.waveform for slice_data in slices]
        pieces = {
            name: None if getattr(held[0], name) is None else np.stack([getattr(w, name) for w in held])
            for name in ARRAYS
        }
        waveform = replace(dataset.waveform, **pieces)  # type: ignore[arg-type]
    first = slices[0]
    return replace(
        dataset,
        waveform=waveform,
        t0_s=first.t0_s,
        water_speed_mps=first.water_speed_mps,
        water_temperature_c=first.water_temperature_c,
        water_temperature_assumed=first.water_temperature_assumed,
        picker=first.picker,
        **{name: several(name) for name in OVER_PAIRS},  # type: ignore[arg-type]
    )


def _corrected(dataset: Dataset, finding: Finding) -> Dataset:
    if finding.check == RECORDING:
        return replace(dataset, t0_s=dataset.t0_s - finding.value)
    if finding.check == OBJECT:
        taken_off = {
            name: getattr(dataset, name) - finding.value
            for name in ("tof_s", "delta_tof_s")
            if getattr(dataset, name) is not None
        }
        return replace(dataset, **taken_off)
    if finding.check == WATER_SPEED:
        return dataset.in_water(finding.value)
    if finding.check == "polarity":
        return replace(dataset, waveform=_with_polarity(dataset, finding))
    return _exchanged(dataset, finding)


def _with_polarity(dataset: Dataset, finding: Finding) -> Waveform | None:
    traces = dataset.waveform
    if traces is None:
        return None
    where = pairs_of(dataset, finding)
    water = None if traces.water is None else invert_polarity(traces.water, where)
    return replace(traces, object=invert_polarity(traces.object, where), water=water)


def _exchanged(dataset: Dataset, finding: Finding) -> Dataset:
    """Exchange two channels in all recorded data."""
    order, axis = exchange_order(dataset, finding)
    return dataset.each_pair_changed(lambda array: reorder_channels(array, order, axis))


def exchange_order(dataset: Dataset, finding: Finding) -> tuple[Ints, int]:
    """The order that exchanges two swapped channels, and its axis of (ntx, nrx)."""
    axis = 0 if finding.role == "emission" else 1
    element = dataset.tx if finding.role == "emission" else dataset.rx
    order = np.arange(len(element))
    a, b = (np.flatnonzero(element == k) for k in finding.elements)
    order[a], order[b] = b, a
    return order, axis


def pairs_of(dataset: Dataset, finding: Finding) -> Flags:
    """(ntx, nrx): pairs with the elements of a finding in its role."""
    element = dataset.tx if finding.role == "emission" else dataset.rx
    wrong = np.isin(element, finding.elements)
    pairs = np.zeros((len(dataset.tx), len(dataset.rx)), dtype=bool)
    pairs[wrong if finding.role == "emission" else (slice(None), wrong)] = True
    return pairs
