"""Hypothesis strategies of datasets: every field there or not, NaN among the values."""

import numpy as np
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from bentray_kernels.acquisition import Dataset, Truth, Waveform

times = st.floats(-1e-5, 1e-5) | st.just(float("nan"))
text = st.text(st.characters(codec="utf-8", exclude_categories=("C", "Z")), max_size=12)


def maybe(strategy):
    return st.none() | strategy


@st.composite
def datasets(draw) -> Dataset:
    ndim = draw(st.sampled_from([2, 3]))
    elements = draw(st.integers(3, 6))
    # A ring with its elements out of place by up to a tenth of its radius.
    angle = 2.0 * np.pi * np.arange(elements) / elements
    ring = np.column_stack((np.cos(angle), np.sin(angle), np.zeros(elements)))[:, :ndim]
    position = draw(st.floats(0.05, 0.2)) * (
        ring + draw(hnp.arrays(np.float64, (elements, ndim), elements=st.floats(-0.1, 0.1)))
    )
    index = st.lists(st.integers(0, elements - 1), min_size=1, max_size=6).map(
        lambda v: np.array(v, dtype=np.int64)
    )
    tx, rx = draw(index), draw(index)
    slices = draw(maybe(st.integers(1, 3)))
    pairs = (*(() if slices is None else (slices,)), len(tx), len(rx))

    def over_pairs(elements):
        return maybe(hnp.arrays(np.float64, pairs, elements=elements))

    waveform = None
    if draw(st.booleans()):
        dtype = draw(st.sampled_from([np.int16, np.float32]))
        traces = hnp.arrays(dtype, (*pairs, draw(st.integers(1, 9))))
        received = draw(traces)
        water = draw(maybe(hnp.arrays(dtype, received.shape)))
        waveform = Waveform(
            received, water, draw(st.floats(1e-12, 1e3)), draw(over_pairs(times)), draw(over_pairs(times))
        )
    water_speed = draw(st.floats(1300.0, 1700.0))
    distance = np.linalg.norm(position[tx][:, None] - position[rx][None], axis=-1)
    absolute = draw(over_pairs(times))
    delta = draw(over_pairs(times))
    if waveform is None and delta is None:
        delta = np.full(pairs, np.nan)
    truth = None
    if draw(st.booleans()):
        shape = draw(hnp.array_shapes(min_dims=2, max_dims=3, max_side=4))
        truth = Truth(
            draw(hnp.arrays(np.float64, shape, elements=st.floats(1300.0, 1700.0))),
            tuple(draw(st.lists(st.floats(1e-4, 1e-2), min_size=len(shape), max_size=len(shape)))),
            tuple(draw(st.lists(st.floats(-1.0, 1.0), min_size=len(shape), max_size=len(shape)))),
            draw(maybe(hnp.arrays(np.float64, shape, elements=st.floats(0.0, 20.0)))),
            "x,y" if len(shape) == 2 else "x,y,z",
        )
    return Dataset(
        element_position_m=position,
        tx=tx,
        rx=rx,
        water_speed_mps=water_speed,
        # A file with a speed alone is read with the temperature that follows from it.
        water_temperature_c=draw(st.floats(0.0, 90.0)),
        tof_s=None if absolute is None else absolute + distance / water_speed,
        delta_tof_s=delta,
        sigma_s=draw(over_pairs(st.floats(1e-10, 1e-6) | st.just(float("nan")))),
        log_ratio_np=draw(over_pairs(times)),
        valid=draw(maybe(hnp.arrays(np.bool_, pairs))),
        roi=draw(maybe(hnp.arrays(np.bool_, (3, 4)))),
        waveform=waveform,
        truth=truth,
        slice_z_m=None if slices is None else np.linspace(0.0, 0.01, slices),
        element_normal=draw(maybe(st.just(np.ones_like(position)))),
        wavelet=draw(maybe(st.just(np.array([0.0, 1.0, -0.5])))),
        array_type=draw(st.sampled_from(["ring", "rings", "free"])),
        radius_m=draw(maybe(st.floats(0.01, 1.0))),
        center_frequency_hz=draw(maybe(st.floats(1e4, 1e7))),
        sampling_rate_hz=draw(st.floats(1e5, 1e8)),
        t0_s=draw(st.floats(-1e-4, 1e-4)),
        water_attenuation_np_m=draw(maybe(st.floats(0.0, 10.0))),
        amplitude_frequency_hz=draw(maybe(st.floats(1e4, 1e7))),
        picker=draw(text),
        title=draw(text),
        source=draw(text),
        license=draw(text),
    )


def small() -> Dataset:
    """A dataset with a bit of everything, large enough for packed chunks."""
    elements, nt = 24, 20
    angle = 2.0 * np.pi * np.arange(elements) / elements
    every = np.arange(elements)
    random = np.random.default_rng(0)
    return Dataset(
        element_position_m=0.1 * np.column_stack((np.cos(angle), np.sin(angle))),
        tx=every[::2],
        rx=every,
        water_speed_mps=1500.0,
        delta_tof_s=random.normal(0.0, 1e-6, (12, 24)),
        valid=random.random((12, 24)) > 0.1,
        waveform=Waveform(
            random.integers(-900, 900, (12, 24, nt)).astype(np.int16),
            random.integers(-900, 900, (12, 24, nt)).astype(np.int16),
        ),
        truth=Truth(np.full((32, 32), 1500.0), (1e-3, 1e-3), (-0.016, -0.016)),
        sampling_rate_hz=1e7,
        center_frequency_hz=1e6,
        title="small",
    )
