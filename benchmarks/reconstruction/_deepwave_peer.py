"""Full-waveform inversion by deepwave's wave equation and its gradient, with L-BFGS of PyTorch."""

import importlib
import math

import numpy as np
from scipy.ndimage import zoom
from scipy.signal import butter, sosfiltfilt

from bentray_kernels.acquisition import Dataset

# Highest frequencies of the bands, parts of the centre frequency, and L-BFGS iterations in each; below
# ``LOWEST`` of it the pulse of the sample scan has no more than the noise.
BANDS, LOWEST, ITERATIONS = (0.8, 1.2), 0.5, 8
# Grid cells in the shortest wavelength, as deepwave recommends for its order of accuracy of 4.
CELLS, ACCURACY, PML_CELLS = 6.0, 4, 10
# Speed of the shortest wavelength, and the speeds that an image may have, m/s.
SLOW_MPS, SPEED_RANGE_MPS = 1400.0, (1300.0, 1800.0)
# Shortest wavelengths of water before the elements. Updates are not smoothed: with another
# filter of the band a Gaussian of 0.15 wavelengths gave 13.7 m/s, 0.03 gave 11.4, and 14 iterations 11.6.
RIM = 1.0
# Speed, m/s, by which the unknowns of L-BFGS are scaled, so that its first step is neither tiny nor wild.
SCALE_MPS = 100.0


def full_waveforms(dataset: Dataset, start: np.ndarray, side_m: float) -> np.ndarray:
    """Speed, (nodes, nodes) m/s, on the grid of the last band, a square of ``side_m`` centred on 0.

    Args:
        dataset: a scan with traces of object and water.
        start: (nodes, nodes), m/s, on any grid of that square.
        side_m: distance of the first from the last node, m.
    """
    torch = importlib.import_module("torch")
    # Two threads took three times the processor time on a machine with other work.
    torch.set_num_threads(1)
    for part in BANDS:
        start = invert_band(torch, dataset, start, side_m, part * dataset.center_frequency_hz)
    return start


def invert_band(torch, dataset: Dataset, start: np.ndarray, side_m: float, highest_hz: float) -> np.ndarray:
    """One band, on a grid of its own, from the image of the band before."""
    wavelength = SLOW_MPS / highest_hz
    nodes = math.ceil(side_m / wavelength * CELLS) + 1
    spacing = side_m / (nodes - 1)
    simulate = simulation(torch, dataset, side_m, spacing, highest_hz)
    waves, step = dataset.waveform, 1.0 / dataset.sampling_rate_hz
    lowest_hz = LOWEST * dataset.center_frequency_hz
    in_band = butter(4, (lowest_hz, highest_hz), "bandpass", fs=1.0 / step, output="sos")
    measured, in_water = (
        torch.tensor(sosfiltfilt(in_band, traces).copy(), dtype=torch.float32)
        for traces in (waves.object, waves.water)
    )
    # The wavelet of each emitter that turns the simulated traces through water into the measured ones.
    trial = torch.tensor(ricker(highest_hz, step, measured.shape[-1])).float().expand(len(measured), -1)
    with torch.no_grad():
        through_water = simulate(torch.full((nodes, nodes), dataset.water_speed_mps), trial)
        wavelet = matched(torch, trial, through_water, in_water)

    axis = np.linspace(-0.5 * side_m, 0.5 * side_m, nodes)
    reach = np.linalg.norm(dataset.element_position_m, axis=1).min() - RIM * wavelength
    scale = torch.tensor(SCALE_MPS * (np.hypot(axis[:, None], axis) <= reach), dtype=torch.float32)
    begin = torch.tensor(zoom(start, nodes / len(start), order=1, mode="nearest"), dtype=torch.float32)
    unknown = torch.zeros((nodes, nodes), requires_grad=True)

    def speed():
        return (begin + scale * unknown).clamp(*SPEED_RANGE_MPS)

    def misfit():
        optimiser.zero_grad()
        loss = (simulate(speed(), wavelet) - measured).square().sum() / measured.square().sum()
        loss.backward()
        return loss

    optimiser = torch.optim.LBFGS([unknown], max_iter=ITERATIONS, line_search_fn="strong_wolfe")
    optimiser.step(misfit)
    return speed().detach().numpy().astype(float)


def simulation(torch, dataset: Dataset, side_m: float, spacing: float, highest_hz: float):
    """Traces, (emitters, receivers, samples), as a function of speed and of the wavelet of each emitter.

    An element acts on the four nodes around it: deepwave's own interpolation of places between nodes takes
    twenty times as long as the waves.
    """
    deepwave = importlib.import_module("deepwave")
    place = (dataset.element_position_m + 0.5 * side_m) / spacing
    low = np.floor(place).astype(int)
    corner = np.array(list(np.ndindex(2, 2)))
    node = torch.tensor(low[:, None] + corner)
    beyond = (place - low)[:, None]
    weight = torch.tensor(np.where(corner, beyond, 1.0 - beyond).prod(axis=-1), dtype=torch.float32)
    # No node may record twice.
    recorder, number = torch.unique(node[dataset.rx].reshape(-1, 2), dim=0, return_inverse=True)

    def simulate(speed, wavelet):
        recorded = deepwave.scalar(
            speed,
            spacing,
            1.0 / dataset.sampling_rate_hz,
            source_amplitudes=weight[dataset.tx][..., None] * wavelet[:, None],
            source_locations=node[dataset.tx],
            receiver_locations=recorder.expand(len(dataset.tx), -1, -1),
            accuracy=ACCURACY,
            pml_width=PML_CELLS,
            pml_freq=highest_hz,
            max_vel=1.01 * SPEED_RANGE_MPS[1],
        )[-1]
        corners = recorded[:, number].unflatten(1, (len(dataset.rx), len(corner)))
        return (corners * weight[dataset.rx][..., None]).sum(dim=2)

    return simulate


def ricker(peak_hz: float, step: float, samples: int) -> np.ndarray:
    """A Ricker wavelet that begins with the trace."""
    square = (math.pi * peak_hz * (step * np.arange(samples) - 1.5 / peak_hz)) ** 2
    return (1.0 - 2.0 * square) * np.exp(-square)


def matched(torch, trial, simulated, measured):
    """The wavelet of each emitter with which ``simulated`` fits best, by least squares in frequency."""
    samples = trial.shape[-1]
    sent, made, wanted = (torch.fft.rfft(traces, 2 * samples) for traces in (trial, simulated, measured))
    power = made.abs().square().sum(dim=1)
    factor = (made.conj() * wanted).sum(dim=1) / (power + 1e-4 * power.max())
    return torch.fft.irfft(factor * sent, 2 * samples)[..., :samples]
