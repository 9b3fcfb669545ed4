"""Threads that share a grid: each plane is worked on once, in groups that are not too small."""

import threading

import numpy as np
import pytest

from bentray_kernels.compilation.thread_team import SINGLE_THREAD, thread_team
from bentray_kernels.eikonal.diagonals import Diagonals


@pytest.mark.parametrize(("planes", "least", "groups"), [(9, 3, 3), (8, 3, 2), (2, 3, 1), (40, 1, 4)])
def test_each_plane_is_in_one_group(planes, least, groups):
    results = []
    with thread_team(4) as team:
        team.map_blocks(lambda first, end: results.append((first, end)), planes, least)
    results.sort()
    assert len(results) == groups
    assert [plane for first, end in results for plane in range(first, end)] == list(range(planes))
    assert planes < least or all(end - first >= least for first, end in results)


def test_threads_work_at_the_same_time_and_end():
    meeting = threading.Barrier(3, timeout=120.0)
    before = threading.active_count()
    with thread_team(3) as team:
        team.map_blocks(lambda _first, _end: meeting.wait(), 3, 1)
    assert threading.active_count() == before


@pytest.mark.parametrize("shape", [(7, 6, 9), (1, 4, 5), (2, 3, 3), (6, 5)])
def test_grids_are_copied_as_by_one_thread(shape):
    random = np.random.default_rng(1)
    grid = Diagonals.from_shape(shape)
    inner, padded = random.random(np.prod(shape)), random.random(np.prod([n + 2 for n in shape]))
    changed = grid.empty_ranges()
    grid.include_neighbours(np.flatnonzero(random.random(padded.size) < 0.05), changed)

    def copies(team):
        arrays = np.empty((6, grid.size))
        for array in arrays:
            team.fill(array, -1.0)
        grid.copy(inner, arrays[0], True, scale=2.0, border=False, team=team)
        grid.copy(padded, arrays[1], False, team=team)
        grid.mirror(arrays[1], arrays[2], team)
        grid.mirror(arrays[1], arrays[3], team, changed)
        grid.mirror(arrays[1], arrays[4], team, grid.empty_ranges())
        team.copy(arrays[1], arrays[5])
        back, inside, flipped = np.zeros(padded.size), np.zeros(inner.size), grid.empty_ranges()
        grid.copy(back, arrays[2], True, back=True, team=team)
        grid.copy(inside, arrays[0], True, border=False, back=True, team=team)
        grid.mirror_mask(changed, flipped, team)
        return [*arrays, back, inside, *flipped]

    alone = copies(SINGLE_THREAD)
    with thread_team(3) as team:
        for first, several in zip(alone, copies(team), strict=True):
            assert np.array_equal(first, several)
    # Some were copied, not all.
    assert 0 < np.count_nonzero(alone[3] >= 0.0) < padded.size
    assert np.array_equal(alone[-4], padded)
