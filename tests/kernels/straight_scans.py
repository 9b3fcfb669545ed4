"""Scans of rings along straight rays, and measured scans of other fields."""

from pathlib import Path

import numpy as np
from scipy.io import loadmat

from bentray_kernels.acquisition import Dataset
from bentray_kernels.acquisition.simulation.ring_scan import Ring

DATA = Path(__file__).parents[3] / "shared" / "data"


def ring_scan(elements, ring_m, delta_tof_s=None, water_mps=1500.0, **fields):
    """A ring of that radius whose every element sends and receives; no delays unless given, (k, k), s."""
    everyone = np.arange(elements)
    delta = np.zeros((elements, elements)) if delta_tof_s is None else delta_tof_s
    position = Ring(elements, ring_m).positions()
    return Dataset(position, everyone, everyone, water_mps, delta_tof_s=delta, **fields)


def chords_m(dataset, radius_m, centre_m=(0.0, 0.0)):
    """Length of each path within a disc or a ball, (ntx, nrx), m."""
    position = dataset.element_position_m
    start = position[dataset.tx][:, None]
    along = position[dataset.rx][None] - start
    unit = along / np.maximum(np.linalg.norm(along, axis=-1), 1e-12)[..., None]
    to = np.resize([*centre_m, 0.0], position.shape[1]) - start
    off = np.linalg.norm(to - (to * unit).sum(axis=-1)[..., None] * unit, axis=-1)
    return 2.0 * np.sqrt(np.maximum(radius_m**2 - off**2, 0.0))


def trunk():
    """Sonic times of a decayed trunk: apparent speeds of 458 to 2,272 m/s."""
    position = loadmat(DATA / "tree_markers.mat")["Markers"].astype(float)
    everyone = np.arange(len(position))
    times = 1e-6 * loadmat(DATA / "tree_runtimes.mat")["Runtimes"].astype(float)
    return Dataset(position - position.mean(axis=0), everyone, everyone, 1500.0, tof_s=times)


def radar():
    """Crosshole radar, scaled to a tenth and to water."""
    stored = loadmat(DATA / "arrenaes_am13.mat")
    (sent, e), (heard, r) = (np.unique(stored[name], axis=0, return_inverse=True) for name in "SR")
    times = np.full((len(sent), len(heard)), np.nan)
    times[e.ravel(), r.ravel()] = stored["d_obs"].ravel() * 1e-9 * 0.1 * 1.4e8 / 1500.0
    position, every = 0.1 * np.concatenate((sent, heard)), np.arange(len(sent) + len(heard))
    centred = position - position.mean(axis=0)
    return Dataset(centred, every[: len(sent)], every[len(sent) :], 1500.0, tof_s=times)
