"""Bytes that the calls of a reconstruction take, counted from the arrays that the kernels make.

``tests/workers/reconstruction/test_planning.py`` holds them against measured peaks. They are what a process
takes beyond what a warm worker holds anyway.
"""

from __future__ import annotations

import math

from bentray_kernels.eikonal.diagonals import Diagonals
from bentray_kernels.rays.in_step import LONGEST
from bentray_kernels.tomography.problem import MARGIN_NODES
from bentray_kernels.tomography.settings import Settings
from bentray_kernels.tomography.solver_choice import solver_of
from bentray_kernels.tomography.stage_graphs import BATCH

from ...cluster.capacities import MIB, REAL
from ...files.dataset.counts import Summary
from .arrival_memory import arrival_call_bytes, emissions_a_call, settle_bytes

# Python's own part of any call.
FLOOR_BYTES = 7 * MIB // 2

# Bytes a padded node of a travel time with its gradient, spline and copies, beside the sweeps' arrays.
FIELD_BYTES_PER_NODE = 80

# Entries of a ray's row over the nodes of a side: chords are 0.64 of the ring's width on average, and each
# step between nodes touches the corners of its cells. In space a level ray stays in its plane.
ENTRIES_LEVEL, ENTRIES_IN_SPACE = 1.55, 3.1

# An entry is a column of 4 bytes and a length of 4.
ENTRY_BYTES = 8


def field_bytes(shape: tuple[int, ...], method: str) -> int:
    """Peak of one travel time with what rays are traced by.

    Args:
        shape: (nx, ny[, nz]).
        method: one of ``eikonal.methods()``.
    """
    nodes = math.prod(n + 2 for n in shape)
    # Both grids of times and crossings, and the one that says that nothing is known.
    swept = 5 * REAL * Diagonals.of(shape).size if method in ("accurate", "fsm") else 0
    return FIELD_BYTES_PER_NODE * nodes + swept


def shape_of(scan: Summary, settings: Settings) -> tuple[int, ...]:
    """Of an image, as ``Problem.of`` makes it."""
    nodes = settings.nodes
    if settings.decomposition == "slices":
        return nodes, nodes
    side = settings.side_m or scan.width_m * (nodes - 1) / (nodes - 1 - 2 * MARGIN_NODES)
    heights = math.ceil(scan.height_m * (nodes - 1) / side) + 1 + 2 * MARGIN_NODES
    return nodes, nodes, heights


def emitters_of(scan: Summary, settings: Settings) -> int:
    """Emitters of one problem."""
    return scan.emitters * (scan.slices if settings.decomposition == "volume" else 1)


def rays_of(scan: Summary, settings: Settings) -> int:
    """Rays of one problem that are rows at a time."""
    rays = emitters_of(scan, settings) * scan.receivers
    return -(-rays // 2) if settings.method == "gauss-newton" and settings.numerics.reciprocity else rays


def _entries(settings: Settings, in_space: bool) -> float:
    """Of a ray's row."""
    level = settings.decomposition == "slices" or (settings.rays == "straight" and not in_space)
    return settings.nodes * (ENTRIES_LEVEL if level else ENTRIES_IN_SPACE)


def rows_bytes(scan: Summary, settings: Settings, rays: int) -> int:
    """Of so many rays as ``linearisation.Rows``: their entries, and a pointer and a residual each."""
    return math.ceil(rays * (_entries(settings, scan.in_space) * ENTRY_BYTES + 2 * REAL))


def state_bytes(shape: tuple[int, ...], settings: Settings) -> int:
    """Slowness and coverage; Gauss–Newton has the best image, the one it began with and the dual too."""
    images = 2 if settings.method == "sart" else 4 + len(shape)
    return images * REAL * math.prod(shape)


def call_bytes(scan: Summary, settings: Settings) -> dict[str, int]:
    """Bytes of each kind of call of one way to reconstruct.

    Args:
        scan: the dataset.
        settings: of one way; never ``method`` auto.

    Returns:
        By the name of the task, in ``arrivals`` too where traces must be picked: working arrays, arguments
        and result, and what the process keeps of the dataset.
    """
    shape, rays = shape_of(scan, settings), rays_of(scan, settings)
    image = REAL * math.prod(shape)
    state = state_bytes(shape, settings)
    # A process keeps the dataset's times and losses, and those of problems that it was asked for last.
    kept = 3 * REAL * scan.pairs + 3 * REAL * emitters_of(scan, settings) * scan.receivers
    tracked = shape
    if settings.numerics.axial_margin_nodes is not None and len(shape) == 3:
        tracked = (*shape[:2], min(shape[2], 2 * settings.numerics.axial_margin_nodes + 2))
    field = 2 * REAL * math.prod(tracked)
    if settings.rays != "straight":
        field = field_bytes(tracked, settings.ray_eikonal)
    base = FLOOR_BYTES + kept + state

    def look(rows: int) -> int:
        share = min(BATCH, emitters_of(scan, settings)) / max(1, emitters_of(scan, settings))
        # The parts of each emitter, and the same put together.
        return base + field + image + 2 * rows_bytes(scan, settings, math.ceil(share * rows))

    def step(rows: int) -> int:
        # Beside each row its time, what is missed, Huber's weight and their product.
        entries = rows * _entries(settings, scan.in_space)
        return base + math.ceil(entries * ENTRY_BYTES) + 5 * REAL * rows + (8 + 8 * len(shape)) * image

    found: dict[str, int] = {}
    if scan.traces_bytes:
        found |= arrival_call_bytes(scan.traces, scan.pairs, settings)
        if settings.numerics.guided_rounds and scan.traces is not None:
            # The rays of each of its emissions through the image that guides it.
            part = emissions_a_call(scan.traces.receivers * scan.traces.samples)
            part = min(part, scan.traces.emissions)
            found["read"] += field + 2 * image + 2 * rows_bytes(scan, settings, part * scan.traces.receivers)
    elif scan.period and settings.picking.examine:
        found["settle"] = settle_bytes(scan.pairs // scan.slices)
    if settings.method == "gauss-newton":
        found["trace_rays"] = look(rays)
        found["update_gauss_newton"] = step(rays)
    elif solver_of(settings, len(shape)).compiled:
        found["update_sart"] = base + _pass_bytes(shape, scan.receivers)
    else:
        found["update_sart"] = base + field + 8 * image
    if settings.attenuation.enabled and scan.amplitudes:
        found["trace_attenuation_rays"] = look(rays)
        found["solve_attenuation"] = step(rays)
    if settings.resolution_check:
        found["trace_resolution_rays"] = look(rays)
        found["check_resolution"] = step(rays)
    return found


def _pass_bytes(shape: tuple[int, ...], receivers: int) -> int:
    """Of the arrays of ``emitter_pass.EmitterPass``: sheets, rays in step, fields; float32."""
    steps = LONGEST * sum(shape)
    return MIB + 4 * (8 * Diagonals.of(shape).size + 3 * steps * receivers + 12 * math.prod(shape))
