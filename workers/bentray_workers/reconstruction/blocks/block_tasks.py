"""Tasks of SART in one block: sweeps of a travel time, parts of rays, back-projection, update."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from bentray_kernels.arrays import Floats, Ints
from bentray_kernels.eikonal.subdomains import Block, Halo, face_of, sides
from bentray_kernels.rays.block_tracing import WaitingRays, back_project_block, trace_block
from bentray_kernels.tomography.sart.sart_update import apply_update, smoothed_update, smoothing_reach
from bentray_kernels.tomography.settings import Settings

from .block_files import COVERAGE, REGION, SLOWNESS, BlockFiles, file_name, read_planes, write_array

# As of ``eikonal.fast_sweeping``.
TOLERANCE = 1e-12


class SweepOrder(NamedTuple):
    """One sweep of a block.

    Attributes:
        seeds: times of its nodes around the source, s.
        version: of the times that it writes.
        before: version of its times so far; None: there are none.
        beyond: version of the times of the blocks below and above, where their outermost planes have become
            earlier; None: they have not.
    """

    seeds: Mapping[tuple[int, ...], float]
    version: str
    before: str | None
    beyond: tuple[str | None, str | None]


class TracedParts(NamedTuple):
    """Result of ``trace_rays_in_block``; the points are in a file. See ``RayParts``."""

    starts: Ints
    ends: Ints
    places: Floats
    predicted: Floats
    lengths: Floats


class BackProjected(NamedTuple):
    """Parts of rays in one block.

    Attributes:
        points: name of their file.
        starts: see ``RayParts``.
        corrections: (rays,), s per node; NaN for those that count nothing.
    """

    points: str
    starts: Ints
    corrections: Floats


def sweep_block(
    files: BlockFiles, update: int, block: int, spacing: float, order: SweepOrder
) -> tuple[bool, bool]:
    """Task: sweep one block until its times have converged.

    Returns:
        Whether its outermost planes have become earlier, below and above.
    """
    scratch = files.scratch(update)
    slowness = read_planes(files.state(update) / file_name(SLOWNESS, block))
    # As the undivided solver, whose medium is a speed.
    slowness = 1.0 / (1.0 / slowness)
    times, sent_halo = None, None
    if order.before is not None:
        times = read_planes(scratch / file_name(order.before, block))
        every = sides(times.ndim)
        sent_halo = Halo(tuple(face_of(times, side) for side in every), (False,) * len(every))
    faces: list[Floats | None] = [None] * (2 * slowness.ndim)
    for side, name in enumerate(order.beyond):
        if name is not None:
            other = block + (1 if side else -1)
            start, stop = files.bounds(other)
            plane = 0 if side else stop - start - 1
            faces[side] = read_planes(scratch / file_name(name, other), plane, plane + 1)[0]
    swept = Block(slowness, spacing, order.seeds, times)
    del times
    halo = swept.sweep(faces, sent_halo, TOLERANCE)
    write_array(scratch / file_name(order.version, block), swept.times())
    return halo.changed[0], halo.changed[1]


def trace_rays_in_block(
    files: BlockFiles,
    update: int,
    block: int,
    spacing: float,
    versions: Sequence[str],
    source: Floats,
    rays: WaitingRays,
    points: str,
) -> TracedParts:
    """Task: trace rays until they leave a block.

    Args:
        files, block, spacing: of the volume.
        update: in progress.
        versions: of the times of each block; none for straight rays.
        source: (3,), nodes.
        rays: see ``WaitingRays``.
        points: name of the file that it writes.
    """
    planes = files.planes(block)
    scratch, state = files.scratch(update), files.state(update)
    tof = files.read(scratch, versions, planes.low, planes.high) if versions else None
    slowness = files.read(state, SLOWNESS, planes.low, planes.high)
    paths = trace_block(tof, slowness, spacing, planes, source, rays)
    write_array(scratch / file_name(points, block), paths.points)
    return TracedParts(paths.starts, paths.ends, paths.places, paths.predicted, paths.lengths)


def back_project_in_block(
    files: BlockFiles, update: int, block: int, parts: Sequence[BackProjected], sums: str
) -> None:
    """Task: add up corrections and weights of the nodes of one block, and of its neighbours' next to it.

    Args:
        files, update, block: as of ``trace_rays_in_block``.
        parts: in the order in which they are added.
        sums: name of the file that it writes.
    """
    planes, scratch = files.planes(block), files.scratch(update)
    shape = planes.high - planes.low, *files.shape[1:]
    added = np.zeros((2, *shape))
    for path in parts:
        points = read_planes(scratch / file_name(path.points, block))
        back_project_block(shape, points, path.starts, path.corrections, *added)
    # By planes, so that neighbours can read some of them.
    for number, name in enumerate(sum_names(sums)):
        write_array(scratch / file_name(name, block), added[number])


def update_block(
    files: BlockFiles,
    update: int,
    block: int,
    spacing: float,
    sums: Sequence[tuple[str, Sequence[int]]],
    settings: Settings,
    first: bool,
) -> None:
    """Task: the slowness and coverage of one block after an update.

    Args:
        files, update, block, spacing: as of ``trace_rays_in_block``.
        sums: of each emitter of the update its name, and the blocks with rays.
        settings: of SART.
        first: whether an iteration begins, and with it the coverage.
    """
    start, stop = files.bounds(block)
    reach = smoothing_reach(settings)
    low, high = max(start - reach, 0), min(stop + reach, files.shape[0])
    corrections, weights = np.zeros((2, high - low, *files.shape[1:]))
    for name, blocks in sums:
        for other in blocks:
            planes = files.planes(other)
            begin, end = max(low, planes.low), min(high, planes.high)
            for values, into in zip(sum_names(name), (corrections, weights), strict=True):
                if begin < end:
                    path = files.scratch(update) / file_name(values, other)
                    into[begin - low : end - low] += read_planes(path, begin - planes.low, end - planes.low)
    region = files.read(files.folder, REGION, low, high, np.bool_)
    own = slice(start - low, stop - low)
    change = smoothed_update(corrections, weights, region, spacing, settings)[own]
    before, after = files.state(update), files.state(update + 1)
    slowness = read_planes(before / file_name(SLOWNESS, block))
    apply_update(slowness, change, region[own], settings)
    write_array(after / file_name(SLOWNESS, block), slowness, lasting=True)
    coverage = np.zeros_like(slowness) if first else read_planes(before / file_name(COVERAGE, block))
    coverage += weights[own] * spacing
    write_array(after / file_name(COVERAGE, block), coverage, lasting=True)


def sum_names(sums: str) -> tuple[str, str]:
    return f"{sums}-corrections", f"{sums}-weights"
