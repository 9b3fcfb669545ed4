"""Source wavelet of a band, estimated anew from the traces of the object with the image reached so far."""

import numpy as np

from ...arrays import Floats
from .source_calibration import calibration_emitters
from .waveform_problem import WaveProblem
from .wavelet import fit_wavelet


def estimate_source(problem: WaveProblem, speed: Floats, window_s: tuple[float, float]) -> Floats:
    """The wavelet with which traces simulated in an image fit the recorded ones best, (steps,).

    Regularised deconvolution of recorded by simulated traces, over all receivers of a few emitters. Each
    recorded trace has the energy of the simulated one, so that gains of emitters and receivers do not matter.

    Args:
        problem: of the band, with a first wavelet.
        speed: (nx, ny), the image, m/s.
        window_s: (before, after) the arrival in water, in which traces are compared, s.
    """
    medium = problem.medium(speed)
    pairs = []
    for emitter in calibration_emitters(problem):
        valid = problem.valid_receivers(emitter)
        model = problem.simulated(medium, emitter, valid, problem.wavelet)
        window = problem.window(emitter, valid, window_s)
        simulated, recorded = window * model, window * problem.recorded(emitter, valid)
        energies = [(traces**2).sum(axis=1, keepdims=True) for traces in (simulated, recorded)]
        gain = np.sqrt(energies[0] / np.where(energies[1] > 0.0, energies[1], 1.0))
        pairs.append((simulated, gain * recorded))
    simulated, recorded = (np.concatenate(arrays) for arrays in zip(*pairs, strict=True))
    return fit_wavelet(problem.wavelet, simulated, recorded)
