"""Adapter of k-Wave in Python: traces of a point source as from our simulator."""

import importlib
import importlib.util
import sys
from collections.abc import Callable
from importlib.metadata import version
from types import SimpleNamespace
from typing import Any

import numpy as np
import scipy.fft

from ..shared._available import available

# Traces, (receivers, nt): (speed (nx, ny) m/s, spacing m, time step s, emitter's node (2,), receivers' nodes
# (receivers, 2), wavelet (nt,), loss (nx, ny) Np/m or None), everything as in ``wave.simulation.simulate``.
Peer = Callable[..., np.ndarray]

# Its absorbing layers: nodes at least, and strength. Both are its defaults.
LAYER_NODES, LAYER_STRENGTH = 20, 2.0

# Decibels in a neper.
DB = 20.0 * np.log10(np.e)

# Part of its highest below which its source is taken to be silent: each sample that it sends costs four
# transforms.
SILENT = 3e-5


class Arrays:
    """NumPy with the transforms of SciPy, as what the solver computes with: a third of the time."""

    fft = scipy.fft

    def __getattr__(self, name: str) -> Any:
        return getattr(np, name)


def python_solver() -> Any:
    """Its class ``Simulation``.

    The first file of its package downloads compiled programs whenever it is imported, and fails without a
    network. The solver in Python needs nothing of that file but the version: so the package is put in place
    without running it, and nothing is fetched or written.

    Raises:
        ImportError: where it, or a package that it needs, is not installed.
    """
    if "kwave" not in sys.modules:
        spec = importlib.util.find_spec("kwave")
        if spec is None:
            raise ImportError("No module named 'kwave'")
        package: Any = importlib.util.module_from_spec(spec)
        package.__version__ = version("k-wave-python")
        sys.modules["kwave"] = package
    return importlib.import_module("kwave.solvers.kspace_solver").Simulation


def padded(nodes: int) -> int:
    """Nodes along a side of its grid, absorbing layers and all."""
    return int(scipy.fft.next_fast_len(nodes + 2 * LAYER_NODES))


def kwave(_: Any) -> Peer:
    solver = python_solver()

    def simulate(speed, spacing, step, emitter, receivers, wavelet, loss=None):
        pads = [((padded(n) - n) // 2, (padded(n) - n + 1) // 2) for n in speed.shape]
        corner = [before for before, _ in pads]
        c = np.pad(speed, pads, mode="edge")
        medium = SimpleNamespace(sound_speed=c, density=1000.0)
        if loss is not None:
            # dB/cm; a power of 0 is loss alike at every frequency, as ours, which delays nothing.
            medium.alpha_coeff = np.pad(loss, pads, mode="edge") * DB / 100.0
            medium.alpha_power = 0.0
        sent, heard = np.zeros(c.shape, bool), np.zeros(c.shape, bool)
        sent[tuple(np.asarray(emitter) + corner)] = True
        nodes = tuple((np.asarray(receivers) + corner).T)
        heard[nodes] = True
        simulation = solver(
            SimpleNamespace(Nx=c.shape[0], Ny=c.shape[1], dx=spacing, dy=spacing, Nt=wavelet.size, dt=step),
            medium,
            SimpleNamespace(p_mask=sent, p=mass(wavelet, step, speed[tuple(emitter)], spacing)[None]),
            SimpleNamespace(mask=heard, record=("p",)),
            smooth_p0=False,
            pml_size=(LAYER_NODES, LAYER_NODES),
            pml_alpha=(LAYER_STRENGTH, LAYER_STRENGTH),
            quiet=True,
            dtype=np.float32,
        )
        simulation.xp = Arrays()
        pressure = simulation.run()["p"]
        traces = np.zeros((len(receivers), wavelet.size))
        # Its receivers are in the order of the grid, and its first sample is that after one step.
        traces[np.argsort(np.ravel_multi_index(nodes, c.shape)), 1:] = pressure[:, :-1]
        return traces

    return simulate


def mass(wavelet: np.ndarray, step: float, speed: float, spacing: float) -> np.ndarray:
    """Its source for ours: c / (2 h) times the integral of s, in the middle of time steps, (at most nt,).

    It adds 2 dt / (c h) times its source to the density at a node, with p = c^2 rho; ours is s in
    (1/c^2) p'' - laplacian p = s delta, where the delta of a node is 1 / h^2. It takes out what the grid and
    the time step do to a source (Cox et al., IEEE IUS 2018), so that nothing is left to be fitted.
    """
    size = 2 * wavelet.size
    # So that sums of samples are integrals; sinc(f dt), with the frequency in turns a step.
    exact = np.fft.rfft(wavelet, size) * np.sinc(np.fft.rfftfreq(size))
    integral = step * np.cumsum(np.fft.irfft(exact, size)[: wavelet.size])
    last = np.flatnonzero(np.abs(integral) > SILENT * np.abs(integral).max())[-1]
    return 0.5 * speed / spacing * integral[: last + 1]


# Name to (module, adapter). The module is always there: the adapter imports k-Wave in its own way.
PEERS: dict[str, tuple[str, Callable[..., Peer]]] = {"k-Wave": ("scipy.fft", kwave)}


def installed() -> tuple[dict[str, Peer], dict[str, str]]:
    """k-Wave, if it can be imported here, or why not."""
    return available(PEERS)
