"""Everything automatic, decided in one place before the first task: each value with its reason."""

from collections.abc import Mapping
from typing import NamedTuple, Protocol

import numpy as np

from ..acquisition import Dataset
from ..acquisition.element_pitch import element_pitch
from ..acquisition.water import describe_assumption
from ..errors import InvalidInput
from . import pairs
from .decomposition import automatic_decomposition, distinct_heights
from .device_choice import ScanSize, choose_device
from .image_grid import automatic_nodes
from .scan import Source
from .settings import Settings
from .solver_choice import solver_of
from .stopping import travel_time_noise
from .waveform.automatic_settings import WaveScale, scale_of


class Machine(Protocol):
    """Decisions of the machines that compute; an empty reason where there was nothing to decide."""

    def device(self, size: ScanSize, settings: Settings) -> tuple[str, str]:
        """The device, and why; see ``device_choice.choose_device``."""

    def blocks(self, dataset: Dataset, settings: Settings) -> tuple[int, str]:
        """Blocks into which a volume is cut, and why."""


class Waves(NamedTuple):
    """The full-waveform refinement that may follow an image.

    Attributes:
        scale: of the scan.
        settings: with the bands and emitters that the time budget allows.
        whole_minutes: estimated time without a budget.
        allowed: whether it is made; else it is only judged whether it would help.
    """

    scale: WaveScale
    settings: Settings
    whole_minutes: float
    allowed: bool


class Settled(NamedTuple):
    """Settings without an open question but the model of ``auto``, which validation decides.

    Attributes:
        settings: with nodes, decomposition, device, blocks and uncertainty.
        waves: the refinement that may follow; None without one.
        reasons: by what was decided automatically, the value and why.
    """

    settings: Settings
    waves: Waves | None
    reasons: Mapping[str, str]


def settled(source: Source, settings: Settings, machine: Machine | None = None) -> Settled:
    """Decide what the settings leave open, once for a reconstruction.

    Args:
        source: of a scan with travel times.
        settings: as requested.
        machine: that computes; None: this process.

    Raises:
        InvalidInput: for a setting that does not fit the scan, and a requested device of which there is none.
    """
    dataset = source.dataset()
    reasons = {"water": _water(dataset, settings)}
    decomposition, nodes = settings.decomposition, settings.nodes
    if decomposition is None:
        decomposition = automatic_decomposition(dataset.element_position_m)
        reasons["decomposition"] = f"{decomposition}, since {_arrangement(dataset)}"
    if nodes is None:
        nodes, why = _nodes(dataset, settings.side_m, decomposition)
        reasons["nodes"] = f"{nodes} along a side, {why}"
    sized = settings.changed(decomposition=decomposition, nodes=nodes)
    pairs.count(dataset, sized)
    size = ScanSize(dataset.slices, len(dataset.tx), len(dataset.rx), source.samples)
    device, why = machine.device(size, sized) if machine else choose_device(size, sized)
    if why:
        reasons["device"] = f"{'OpenCL' if device == 'opencl' else 'compiled code'}, {why}"
    # In the memory of one process there is no need for blocks.
    blocks, why = machine.blocks(dataset, sized) if machine else (settings.numerics.blocks, "")
    if why:
        reasons["blocks"] = f"{blocks}, {why}"
    chosen = sized.changed(device=device, blocks=blocks)
    waves = _waves(source, chosen)
    if waves is not None and waves.allowed and settings.minutes is not None:
        bands = waves.scale.bands(waves.settings)
        reasons["bands"] = (
            f"{len(bands)} of {bands[0].emitters} emitters, the most within {settings.minutes:g} minutes of "
            "one core"
        )
    # Of an image by rays: waveforms have deviations only if requested.
    if chosen.uncertainty is None and chosen.estimates_uncertainty:
        reasons["uncertainty"] = "estimated, since it is cheap for slices along bent rays"
    return Settled(chosen.changed(uncertainty=chosen.estimates_uncertainty), waves, reasons)


def reasons_of_model(settings: Settings, requested: Settings, choice: str) -> dict[str, str]:
    """The reasons of what follows from the model of an image.

    Args:
        settings: of the image.
        requested: before ``auto``.
        choice: why ``auto`` chose this model; empty without a choice.
    """
    reasons = {"model": choice} if choice else {}
    solver = solver_of(settings, 3 if settings.decomposition == "volume" else 2)
    if solver.eikonal not in (None, requested.eikonal):
        why = "it alone works in blocks" if settings.numerics.blocks > 1 else "rays are traced one by one"
        reasons["eikonal"] = f"{solver.eikonal} in place of {requested.eikonal}, since {why}"
    return reasons


def in_sentences(reasons: Mapping[str, str]) -> str:
    """Reasons as one text, in the order of the decisions."""
    return "; ".join(f"{name}: {reason}" for name, reason in reasons.items())


def _water(dataset: Dataset, settings: Settings) -> str:
    speed = f"{dataset.water_speed_mps:.1f} m/s"
    if settings.water_temperature_c is not None:
        return f"{speed}, from the temperature of the settings"
    if dataset.water_temperature_assumed and dataset.water_temperature_c is not None:
        return f"{speed}, {describe_assumption(dataset.water_temperature_c)}"
    return f"{speed}, as the scan states it"


def _arrangement(dataset: Dataset) -> str:
    position = dataset.element_position_m
    if position.shape[1] == 2:
        return "the elements lie in a plane"
    heights = distinct_heights(position).size
    if automatic_decomposition(position) == "volume":
        return f"{len(position)} elements at {heights} heights are not stacked rings"
    return "the elements are stacked rings" if heights > 1 else "all elements have one height"


def _nodes(dataset: Dataset, side_m: float | None, decomposition: str) -> tuple[int, str]:
    position, water = dataset.element_position_m, dataset.water_speed_mps
    frequency = dataset.center_frequency_hz
    wavelength = None if frequency is None else water / frequency
    return automatic_nodes(
        side_m or float(np.ptp(position[:, :2], axis=0).max()),
        element_pitch(position),
        wavelength,
        # The wavelength bounds what times can show more reliably than their noise.
        travel_time_noise(dataset) if wavelength is None else 0.0,
        water,
        len(position),
        volume=decomposition == "volume",
    )


def _waves(source: Source, settings: Settings) -> Waves | None:
    """The waveform refinement that may follow; None if not requested, or impossible with ``auto``."""
    dataset, samples = source.dataset(), source.samples if source.has_water else 0
    if settings.method not in ("waveform", "auto") or (settings.method == "auto" and not samples):
        return None
    try:
        scale = scale_of(dataset, settings, samples, pairs.count(dataset, settings))
    except InvalidInput:
        if settings.method == "waveform":
            raise
        return None
    within = scale.budgeted(settings)
    budget = -1.0 if settings.minutes is None else settings.minutes
    allowed = settings.method == "waveform" or scale.minutes(within) <= budget
    return Waves(scale, within, scale.minutes(settings), allowed)
