"""The whole refinement: it finds a blob, through noise, in any number of threads."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

from bentray_kernels.errors import InvalidInput
from bentray_kernels.wave.continuation import refine

from .scans import SETTINGS, error, refined, scan, water


def test_the_blob_is_found():
    start, found = water(), refined()
    assert error(found.image) < 0.5 * error(start)
    assert not found.skipped
    first, last = found.bands[-1].history[0], found.bands[-1].history[-1]
    assert last.misfit < 0.6 * first.misfit
    assert last.held < 0.8 * first.held


def test_it_is_found_through_noise():
    assert error(refine(scan(noise=0.05), SETTINGS, water()).image) < 0.6 * error(water())


def test_threads_give_the_same_bits():
    alone = refined()
    with ThreadPoolExecutor(3) as pool:
        assert np.array_equal(refine(scan(), SETTINGS, water(), run=pool.map).image.speed, alone.image.speed)


def test_progress_is_told_of_every_image():
    told = []
    found = refine(scan(), SETTINGS, water(), progress=lambda problem, state: told.append(len(state.history)))
    assert len(told) == sum(len(end.history) for end in found.bands)


def test_a_start_out_of_bounds_is_refused():
    start = replace(water(), speed=np.full((60, 60), 3000.0))
    with pytest.raises(InvalidInput, match="start"):
        refine(scan(), SETTINGS, start)
