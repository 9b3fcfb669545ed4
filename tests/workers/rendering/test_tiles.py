"""Strips cover a picture once, each with work of about a task, and a small picture is one task."""

from itertools import pairwise
from types import SimpleNamespace

from hypothesis import given
from hypothesis import strategies as st

from bentray_workers.rendering.tiles import TASK_RAYS, tile_rows

SIDES = st.integers(1, 4096)


@given(SIDES, SIDES, st.integers(1, 8))
def test_every_row_is_in_exactly_one_tile(width, height, times):
    parts = tile_rows(SimpleNamespace(width=width, height=height, times=times))
    assert [row for first, last in parts for row in range(first, last)] == list(range(height))
    rays = [(last - first) * width * times**2 for first, last in parts]
    assert all(
        count <= TASK_RAYS or last - first == 1 for count, (first, last) in zip(rays, parts, strict=True)
    )
    # No strip could take the rows of the next one too.
    assert all(one + other > TASK_RAYS for one, other in pairwise(rays[:-1]))
