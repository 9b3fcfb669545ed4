"""Tomography peers: installed ones recover a disc, missing ones are named with the reason."""

import warnings

import numpy as np
import pytest
from benchmarks.reconstruction._tomography_peers import PEERS, installed

from .._small_ring import DISC_MPS, WATER_MPS, disc, ring


@pytest.mark.parametrize("name", list(PEERS))
def test_a_peer_finds_a_disc(name: str) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # a peer's own are its own affair
        peers, missing = installed()
        if name in missing:
            pytest.skip(missing[name])
        times = ring()
        speed = peers[name](times)
    assert speed.shape == times.region.shape
    assert np.isfinite(speed).all()
    assert speed[disc(times, 0.5)].mean() == pytest.approx(DISC_MPS, abs=12.0)
    assert speed[0, 0] == pytest.approx(WATER_MPS)
