"""Benchmark from raw traces to images: picking, rays, attenuation, full-waveform inversion."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from bentray_service.cli.output.benchmark_row import Row
from bentray_service.cli.output.terminal import Step

from . import _acquisition_attenuation, _acquisition_picking, _acquisition_rays, _acquisition_waveform

# Each gives the rows of one part.
MAKERS: tuple[Callable[[bool, Step], Iterable[Row]], ...] = (
    _acquisition_picking.rows,
    _acquisition_rays.rows,
    _acquisition_waveform.rows,
    _acquisition_attenuation.rows,
)


def rows(quick: bool, progress: Step) -> Iterable[Row]:
    """All parts, one after the other."""
    for maker in MAKERS:
        yield from maker(quick, progress)
