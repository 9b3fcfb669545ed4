"""The water shot that a scan lacks, estimated from the chords of the object scan that miss the object."""

import math
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...arrays import Flags, Floats
from ...errors import InvalidInput
from ..dataset import Dataset
from ..emissions import Emissions
from ..noise import robust_deviation
from ..water import stated_deviation
from .chord_pulses import ChordPulses, window
from .water_chords import MIN_CHORDS, WaterChords, find_water_chords

Spectrum = NDArray[np.complex128]

# Fall at the ends of a pulse, periods.
TAPER = 1.0

# Receivers whose traces are computed together.
RECEIVERS_AT_ONCE = 32

# Highest frequency of the model over the centre frequency.
HIGHEST = 3.0

# Least correlation of a chord's pulse with the common pulse.
MIN_CORRELATION = 0.8

# Frequencies with less of the largest amplitude do not determine phases.
FAINT = 0.1

# Pairs that determine the delay and the gain of an element.
MIN_PER_ELEMENT = 4

ROUNDS = 3

# Frequencies that give the group speed, on both sides of the centre, as a part of it.
GROUP = 0.2


@dataclass(frozen=True)
class ReferenceShot:
    """A model of the water shot: pulse, wave number, delays and gains.

    The pulse of a pair has the spectrum
    ``gain_e gain_r / sqrt(d) · spectrum · exp(−i (ω (t_e + t_r + delay) + wave_number d))``.

    Attributes:
        frequency_hz: (n,), equally spaced from 0.
        spectrum: (n,), of the common pulse, relative to its arrival.
        wave_number: (n,), rad/m: measured over distance, so that dispersion is taken along.
        delay_s: of all pairs.
        emission_delay_s, reception_delay_s: (ntx,), (nrx,), s, of mean 0; 0 where no chord determines it.
        emission_gain, reception_gain: (ntx,), (nrx,), logarithms.
        chords: number of chords used.
        speed_mps: fitted phase speed at the centre frequency. The wave number is that of its mean with the
            stated speed, weighted by their variances.
        speed_sigma_mps: its standard deviation: from the scatter of the arrivals, for the distances that the
            delays of elements leave, and half the difference from the group speed, which water does not have.
        noise: standard deviation of the noise in the traces. Pickers find the onset of a noiseless pulse
            earlier than that of a recorded one.
    """

    frequency_hz: Floats
    spectrum: Spectrum
    wave_number: Floats
    delay_s: float
    emission_delay_s: Floats
    reception_delay_s: Floats
    emission_gain: Floats
    reception_gain: Floats
    chords: int
    speed_mps: float
    speed_sigma_mps: float
    noise: float

    def applied(self, dataset: Dataset) -> Dataset:
        """The dataset of one slice with this as its water shot; its traces are computed on access."""
        traces = dataset.traces
        samples = int(traces.object.shape[-1])
        shape = (len(dataset.tx), len(dataset.rx), samples)
        water = Emissions.from_reader(
            partial(self.traces, dataset, samples=samples), shape, np.dtype(np.float32)
        )
        scale = None if traces.object_scale is None else np.ones(shape[:2])
        changed: dict[str, Any] = {"water": water, "water_scale": scale}
        return replace(dataset, waveform=replace(traces, **changed))

    def traces(self, dataset: Dataset, emission: int, samples: int) -> NDArray[np.float32]:
        """The traces of one emission in water, (nrx, samples)."""
        offset = dataset.element_position_m[dataset.rx] - dataset.element_position_m[dataset.tx[emission]]
        distance = np.linalg.norm(offset, axis=1)
        # A period with room for the pulse at either end.
        pulse = math.ceil(dataset.rate_hz / self.frequency_hz[1])
        length = 2 ** math.ceil(math.log2(samples + pulse))
        frequency = np.fft.rfftfreq(length, 1.0 / dataset.rate_hz)
        real, imaginary = (
            np.interp(frequency, self.frequency_hz, component, right=0.0)
            for component in (self.spectrum.real, self.spectrum.imag)
        )
        wave_number = np.interp(frequency, self.frequency_hz, self.wave_number)
        late = self.delay_s + self.emission_delay_s[emission] + self.reception_delay_s - dataset.t0_s
        apart = np.maximum(distance, distance.max() * 1e-3)
        gain = np.exp(self.emission_gain[emission] + self.reception_gain) / np.sqrt(apart)
        random = np.random.default_rng(emission)
        shots = np.empty((len(distance), samples), dtype=np.float32)
        # Some receivers at once, so that the spectra take little memory.
        for begin in range(0, len(distance), RECEIVERS_AT_ONCE):
            block = slice(begin, begin + RECEIVERS_AT_ONCE)
            phase = 2.0 * np.pi * late[block, None] * frequency + distance[block, None] * wave_number
            spectra = gain[block, None] * (real + 1j * imaginary) * np.exp(-1j * phase)
            shots[block] = np.fft.irfft(spectra, length, axis=1)[:, :samples]
            shots[block] += self.noise * random.standard_normal((len(phase), samples))
        return shots


def estimate_reference(dataset: Dataset, chords: WaterChords, pulses: ChordPulses) -> ReferenceShot:
    """Estimate pulse, wave number, delays and gains from chords through water.

    The common pulse and, at each frequency, the phase over distance are fitted in turn with the delays of
    elements; then chords are selected again by their delays to a fraction of a sample.

    Args:
        dataset: of one slice, with a centre frequency; its traces are not read.
        chords: by the maxima of envelopes.
        pulses: of these chords.

    Raises:
        InvalidInput: where too few chords pass through water.
    """
    fit = _Fit(dataset, chords, pulses)
    known_s = fit.known_s
    for _ in range(ROUNDS):
        fit.improve()
    # Envelopes scatter by a tenth of a period; the delays of pulses show which chords touch the object.
    arrival = np.full(chords.pairs.shape, np.nan)
    at = pulses.emission[fit.used], pulses.reception[fit.used]
    arrival[at] = (fit.model_s() + fit.lag_s - known_s)[fit.used]
    again = find_water_chords(dataset, arrival, tolerance=0.01)
    fit.keep(again.pairs)
    for _ in range(ROUNDS):
        fit.improve()
    fitted = fit.fitted()
    if not dataset.water_temperature_assumed:
        usual = stated_deviation(dataset.water_speed_mps, dataset.water_temperature_c)
        fit.weigh(fitted, dataset.water_speed_mps, usual)
    return fit.reference(fitted)


def chord_signs(dataset: Dataset, chords: WaterChords, pulses: ChordPulses) -> Floats:
    """(ntx, nrx): correlation of each chord's pulse with the usual one, from -1 to 1; NaN for other pairs.

    Args:
        dataset, chords, pulses: as ``estimate_reference`` takes them.
    """
    sign = np.full(chords.pairs.shape, np.nan)
    if pulses.emission.size:
        alike = _Fit(dataset, chords, pulses).likeness()
        sign[pulses.emission, pulses.reception] = alike
    return sign


class _Fit:
    """State of the estimation; phases are relative to the arrival by the model."""

    def __init__(self, dataset: Dataset, chords: WaterChords, pulses: ChordPulses) -> None:
        rate, period_s, self._pulses = dataset.rate_hz, 1.0 / dataset.frequency_hz, pulses
        self._period_s = period_s
        self._distance = dataset.distance_m()[pulses.emission, pulses.reception]
        _, length = window(rate * period_s)
        padded = 2 ** math.ceil(math.log2(4 * length))
        frequency = np.fft.rfftfreq(padded, 1.0 / rate)
        self._omega = 2.0 * np.pi * frequency[frequency * period_s <= HIGHEST]
        tapered = pulses.samples * _taper(length, rate * period_s)
        self._spectra = np.fft.rfft(tapered, padded, axis=1)[:, : self._omega.size]
        # From the first sample of a window to the time of the emission.
        begin_s = dataset.t0_s + pulses.begin / rate
        self._spectra *= np.exp(-1j * begin_s[:, None] * self._omega)
        self._delay_s, self._slowness = chords.delay_s, 1.0 / chords.speed_mps
        self._wave_number = self._omega * self._slowness
        self._emission_s, self._reception_s = np.zeros(len(dataset.tx)), np.zeros(len(dataset.rx))
        # Known delays of the elements of each chord, s.
        self.known_s = np.zeros(self._distance.size)
        if chords.emission_delay_s is not None and chords.reception_delay_s is not None:
            self._emission_s += chords.emission_delay_s
            self._reception_s += chords.reception_delay_s
            self.known_s += self._emission_s[pulses.emission] + self._reception_s[pulses.reception]
        self.used = np.ones(self._distance.size, dtype=bool)
        self.lag_s = np.zeros(self._distance.size)

    def keep(self, pairs: Flags) -> None:
        """Use only these pairs, (ntx, nrx)."""
        self.used = pairs[self._pulses.emission, self._pulses.reception]

    def model_s(self) -> Floats:
        """Arrival of each chord by the model, without dispersion, s."""
        return np.asarray(
            self._delay_s
            + self._slowness * self._distance
            + self._emission_s[self._pulses.emission]
            + self._reception_s[self._pulses.reception]
        )

    def likeness(self) -> Floats:
        """Correlation of each chord's pulse with the common pulse."""
        aligned = self._aligned()
        common = _median_spectrum(aligned[self.used])
        size = np.linalg.norm(aligned, axis=1) * np.linalg.norm(common)
        return np.asarray((aligned * np.conj(common)).real.sum(axis=1) / np.where(size > 0.0, size, 1.0))

    def improve(self) -> None:
        """One round: the common pulse, the delays of chords and elements, and the phase over distance."""
        aligned = self._aligned()
        self._pulse = _median_spectrum(aligned[self.used])
        strong = np.abs(self._pulse) > FAINT * np.abs(self._pulse).max()
        power = np.where(strong, np.abs(self._pulse) ** 2, 0.0)
        across = aligned * np.conj(self._pulse)
        self.amplitude = across.real.sum(axis=1) / (np.abs(self._pulse) ** 2).sum()
        size = np.linalg.norm(aligned, axis=1) * np.linalg.norm(self._pulse)
        alike = across.real.sum(axis=1) / np.where(size > 0.0, size, 1.0)
        self.used &= alike > MIN_CORRELATION
        if self.used.sum() < MIN_CHORDS:
            raise InvalidInput(
                "waveform/water",
                f"no traces, and {int(self.used.sum())} chords through water with the same pulse",
                f"a scan without the object, or at least {MIN_CHORDS} chords that miss the object",
            )
        phase = np.angle(across)
        self.lag_s = -(phase * power * self._omega).sum(axis=1) / (power * self._omega**2).sum()
        emission_s, reception_s = self._of_elements(self.lag_s)
        self._emission_s += emission_s
        self._reception_s += reception_s
        # What elements do not explain: the phase over distance, at each frequency.
        moved = emission_s[self._pulses.emission] + reception_s[self._pulses.reception]
        phase = np.angle(across * np.exp(1j * moved[:, None] * self._omega))[self.used]
        apart = self._distance[self.used] - self._distance[self.used].mean()
        slope = apart @ (phase - phase.mean(axis=0)) / (apart @ apart)
        at = np.flatnonzero(strong)
        self._wave_number -= np.interp(self._omega, self._omega[at], slope[at])

    def fitted(self) -> tuple[float, float]:
        """Phase speed at the centre frequency and its standard deviation, m/s; see ``ReferenceShot``."""
        centre = 2.0 * np.pi / self._period_s
        speed = centre / float(np.interp(centre, self._omega, self._wave_number))
        ends = centre * np.array((1.0 - GROUP, 1.0 + GROUP))
        group = float(np.ptp(ends) / np.diff(np.interp(ends, self._omega, self._wave_number))[0])
        emission, reception = self._of_elements(self._distance, centred=False)
        left = self._distance - emission[self._pulses.emission] - reception[self._pulses.reception]
        spread = float(np.std(left[self.used])) * math.sqrt(self.used.sum())
        scatter = robust_deviation(self.lag_s[self.used])
        return speed, math.hypot(scatter / max(spread, 1e-9) * speed**2, 0.5 * (group - speed))

    def weigh(self, fitted: tuple[float, float], stated_mps: float, deviation_mps: float) -> None:
        """Use the mean of the fitted and the stated speed, weighted by their variances.

        Chords near the object are diffracted by it, which the scatter of the arrivals does not show. The
        arrival at the mean distance remains.
        """
        speed, sigma = fitted
        weight = sigma**2 / (sigma**2 + deviation_mps**2)
        change = 1.0 / (speed + weight * (stated_mps - speed)) - 1.0 / speed
        self._wave_number = self._wave_number + self._omega * change
        self._slowness += change
        self._delay_s -= change * float(self._distance[self.used].mean())

    def reference(self, fitted: tuple[float, float]) -> ReferenceShot:
        """The result, with the fitted speed and its standard deviation."""
        size = np.log(np.maximum(self.amplitude, np.finfo(np.float64).tiny) * np.sqrt(self._distance))
        emission_gain, reception_gain = self._of_elements(size, centred=False)
        finite = self._pulses.noise[np.isfinite(self._pulses.noise)]
        speed, sigma = fitted
        return ReferenceShot(
            frequency_hz=np.asarray(self._omega / (2.0 * np.pi), dtype=np.float64),
            spectrum=self._pulse,
            wave_number=np.asarray(self._wave_number, dtype=np.float64),
            delay_s=self._delay_s,
            emission_delay_s=self._emission_s,
            reception_delay_s=self._reception_s,
            emission_gain=emission_gain,
            reception_gain=reception_gain,
            chords=int(self.used.sum()),
            speed_mps=speed,
            speed_sigma_mps=sigma,
            noise=float(np.median(finite)) if finite.size else 0.0,
        )

    def _aligned(self) -> Spectrum:
        """Spectra of the pulses relative to their arrival by the model."""
        late = self._delay_s + self._emission_s[self._pulses.emission]
        late = late + self._reception_s[self._pulses.reception]
        phase = late[:, None] * self._omega + self._distance[:, None] * self._wave_number
        return np.asarray(self._spectra * np.exp(1j * phase))

    def _of_elements(self, values: Floats, *, centred: bool = True) -> tuple[Floats, Floats]:
        """Parts of a value of each chord for its emitter and receiver, by median polish.

        Each has the mean 0 if ``centred``, else the mean is that of the receivers. Elements with few chords
        get 0, or the mean.
        """
        pulses, used = self._pulses, self.used
        table = np.full((self._emission_s.size, self._reception_s.size), np.nan)
        table[pulses.emission[used], pulses.reception[used]] = values[used]
        emission, reception = np.zeros(len(table)), np.zeros(table.shape[1])
        common = float(np.nanmedian(table))
        for _ in range(4):
            emission += _medians(table - common - emission[:, None] - reception)
            reception += _medians((table - common - emission[:, None] - reception).T)
        common += float(emission.mean() + reception.mean())
        emission, reception = emission - emission.mean(), reception - reception.mean()
        return (emission, reception) if centred else (emission, reception + common)


def _taper(length: int, period: float) -> Floats:
    """Half a cosine at both ends of a window, (length,)."""
    ends = max(1, round(TAPER * period))
    ramp = 0.5 - 0.5 * np.cos(np.pi * (np.arange(ends) + 0.5) / ends)
    window = np.ones(length)
    window[:ends], window[-ends:] = ramp, ramp[::-1]
    return window


def _median_spectrum(spectra: Spectrum) -> Spectrum:
    """The common pulse: the median over chords, each scaled to its largest amplitude."""
    size = np.abs(spectra).max(axis=1, keepdims=True)
    scaled = spectra[size[:, 0] > 0.0] / size[size[:, 0] > 0.0]
    return np.asarray(np.median(scaled.real, axis=0) + 1j * np.median(scaled.imag, axis=0))


def _medians(rows: Floats) -> Floats:
    """Median of each row without its NaN; 0 with fewer than ``MIN_PER_ELEMENT`` values."""
    result = np.zeros(len(rows))
    for index, row in enumerate(rows):
        values = row[np.isfinite(row)]
        if values.size >= MIN_PER_ELEMENT:
            result[index] = np.median(values)
    return result
