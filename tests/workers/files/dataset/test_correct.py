"""Corrected copies: values scale exactly and back, implausible ones are refused; units that are suggested."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as some

from bentray_kernels.acquisition import Dataset
from bentray_kernels.errors import InvalidInput
from bentray_workers.files.dataset import Correction, copy, correct_dataset, read_dataset, write_dataset
from bentray_workers.files.dataset.copy import LENGTHS, TIMES, corrected
from bentray_workers.files.dataset.units import POSITION_UNITS, TIME_UNITS, propose

from ....memory_program import peak_of
from ..datasets import small
from ..test_dataset_files import assert_same


def usual(**changes):
    return replace(small(), **changes)


@pytest.mark.parametrize(
    "dataset", [small(), usual(radius_m=0.1, sigma_s=np.full((12, 24), 1e-7), t0_s=2e-5)]
)
def test_a_correction_and_its_inverse_restore_the_scan(tmp_path, dataset):
    dataset = replace(dataset, delta_tof_s=1e-3 * dataset.delta_tof_s, sampling_rate_hz=1e10)
    source, wrong, target = (tmp_path / name for name in ("source.h5", "wrong.h5", "target.h5"))
    write_dataset(source, dataset)
    before = source.read_bytes()
    correct_dataset(source, wrong, Correction("ms", "us", "cm", "mm"))
    told = correct_dataset(wrong, target, Correction("us", "ms", "mm", "cm"), origin="ds-1")
    made = read_dataset(target)
    assert source.read_bytes() == before
    assert told.source == made.source
    stated = "Corrected copy of ds-1: times in us, read as ms before (x 0.001), lengths in mm, read as cm"
    assert made.source.startswith(stated)
    assert "Corrected copy of source.h5: times in ms" in made.source
    for name in (*TIMES, *LENGTHS, "sampling_rate_hz"):
        own, other = getattr(made, name), getattr(dataset, name)
        assert (own is None) == (other is None), name
        if own is not None:
            np.testing.assert_allclose(own, other, rtol=1e-12, err_msg=name)
    assert made.truth.spacing_m == pytest.approx(dataset.truth.spacing_m)
    for name in ("object", "water"):
        np.testing.assert_array_equal(getattr(made.waveform, name), getattr(dataset.waveform, name))
    for name in ("tx", "rx", "valid"):
        np.testing.assert_array_equal(getattr(made, name), getattr(dataset, name))


# Units of the file and units read, by which this scan stays plausible.
UNITS = [
    (*times, *lengths)
    for times in (("ms", "us"), ("us", "ns"), ("s", "ms"), (None, "s"))
    for lengths in (("cm", "mm"), ("mm", "cm"), (None, "m"))
    if times[0] or lengths[0]
]


@given(
    units=some.sampled_from(UNITS),
    share=some.floats(1e-9, 1e-3),
    t0_s=some.just(0.0) | some.floats(1e-9, 1e-6),
    sampling_rate_hz=some.floats(1e10, 9e10),
)
def test_the_inverse_of_any_correction_restores_every_value(units, share, t0_s, sampling_rate_hz):
    true_times, read_times, true_lengths, read_lengths = units
    dataset = usual(
        delta_tof_s=share * small().delta_tof_s, tof_s=None, t0_s=t0_s, sampling_rate_hz=sampling_rate_hz
    )
    inverse = Correction(
        true_times and read_times, true_times or "s", true_lengths and read_lengths, true_lengths or "m"
    )
    made = corrected(corrected(dataset, Correction(*units), "scan"), inverse, "scan")
    for name in (*TIMES, *LENGTHS, "sampling_rate_hz"):
        own, stored = getattr(made, name), getattr(dataset, name)
        assert (own is None) == (stored is None), name
        if stored is not None:
            np.testing.assert_allclose(own, stored, rtol=1e-12, err_msg=name)


def test_each_statement_changes_its_fields_alone():
    dataset = usual(
        sampling_rate_hz=1e10,
        center_frequency_hz=2e6,
        amplitude_frequency_hz=2e6,
        t0_s=1e-6,
        delta_tof_s=1e-3 * small().delta_tof_s,
        sigma_s=np.full((12, 24), 1e-9),
    )

    def changed(**stated):
        made = corrected(dataset, Correction(**stated), "ds-1")
        assert made.source.startswith(f"Corrected copy of ds-1: {Correction(**stated).words()}")
        return replace(made, source=dataset.source)

    times = changed(times_in="ms", times_read_as="us")
    assert_same(
        times,
        replace(
            dataset,
            delta_tof_s=1e3 * dataset.delta_tof_s,
            sigma_s=1e3 * dataset.sigma_s,
            sampling_rate_hz=1e7,
            t0_s=1e3 * dataset.t0_s,
        ),
    )
    assert_same(changed(sampling_rate_hz=2e7), replace(dataset, sampling_rate_hz=2e7))
    assert_same(
        changed(frequency_hz=5e5),
        replace(dataset, center_frequency_hz=5e5, amplitude_frequency_hz=5e5),
    )
    other = replace(dataset, amplitude_frequency_hz=1e6)
    assert corrected(other, Correction(frequency_hz=5e5), "x").amplitude_frequency_hz == 1e6
    lengths = changed(positions_in="cm", positions_read_as="mm")
    np.testing.assert_allclose(lengths.element_position_m, 10.0 * dataset.element_position_m)
    assert lengths.truth.spacing_m == pytest.approx((1e-2, 1e-2))
    assert lengths.truth.origin_m == pytest.approx((-0.16, -0.16))
    np.testing.assert_array_equal(lengths.delta_tof_s, dataset.delta_tof_s)


def test_a_sampling_rate_below_the_pulse_is_refused_unless_it_is_stated():
    dataset = usual(delta_tof_s=1e-3 * small().delta_tof_s)
    with pytest.raises(InvalidInput, match=r"^sampling_rate_hz: .*state sampling_rate_hz if it was right"):
        corrected(dataset, Correction("ms", "us"), "ds-1")
    made = corrected(dataset, Correction("ms", "us", sampling_rate_hz=1e7), "ds-1")
    assert made.sampling_rate_hz == 1e7


@pytest.mark.parametrize(
    ("stated", "field", "accepted"),
    [
        ({}, "correction", "times_in or positions_in"),
        ({"times_in": "s"}, "correction", "times_in or positions_in"),
        ({"times_read_as": "ms"}, "correction", "times_in or positions_in"),
        ({"times_in": "min"}, "times_in", "one of s, ms, us, ns"),
        ({"positions_in": "mm", "positions_read_as": "inch"}, "positions_read_as", "one of m, cm, mm, um"),
        ({"frequency_hz": 1.0}, "frequency_hz", "1000 to"),
        ({"sampling_rate_hz": float("nan")}, "sampling_rate_hz", "1000 to"),
    ],
)
def test_wrong_corrections_name_their_field(stated, field, accepted):
    with pytest.raises(InvalidInput, match=rf"^{field}: .*; accepted: .*{accepted}"):
        Correction(**stated)


def test_an_implausible_scan_is_refused_and_nothing_is_written(tmp_path):
    write_dataset(tmp_path / "scan.h5", small())
    with pytest.raises(InvalidInput, match="after the correction") as caught:
        correct_dataset(tmp_path / "scan.h5", tmp_path / "new.h5", Correction(positions_in="um"))
    assert caught.value.field == "geometry/element_position_m"
    assert "write" not in caught.value.accepted
    assert [path.name for path in tmp_path.iterdir()] == ["scan.h5"]


@pytest.mark.parametrize(
    ("changes", "option", "stated"),
    [
        ({"element_position_m": 1e3 * small().element_position_m}, "positions-in mm", {"positions_in": "mm"}),
        (
            {"delta_tof_s": 1e6 * small().delta_tof_s},
            "times-in us",
            {"times_in": "us", "sampling_rate_hz": 1e7},
        ),
    ],
)
def test_the_unit_for_which_a_file_is_refused_can_be_corrected(tmp_path, changes, option, stated):
    wrong, right = tmp_path / "wrong.h5", tmp_path / "right.h5"
    write_dataset(wrong, usual(**changes))
    with pytest.raises(InvalidInput, match=f"bentray correct SCAN -o COPY --{option}"):
        read_dataset(wrong)
    correct_dataset(wrong, right, Correction(**stated))
    (name,) = changes
    np.testing.assert_allclose(getattr(read_dataset(right), name), getattr(small(), name), rtol=1e-12)


def test_traces_are_copied_in_pieces(tmp_path, monkeypatch):
    dataset = small()
    traces = np.zeros((4, 8, 65536), np.int16)
    kept = dict.fromkeys(("tof_s", "delta_tof_s", "sigma_s", "log_ratio_np", "valid", "slice_z_m"))
    dataset = replace(
        dataset,
        **kept,
        tx=np.arange(4) % len(dataset.element_position_m),
        rx=np.arange(8) % len(dataset.element_position_m),
        sampling_rate_hz=1e7,
        waveform=replace(dataset.waveform, object=traces, water=None, object_scale=None, water_scale=None),
    )
    write_dataset(tmp_path / "scan.h5", dataset)
    monkeypatch.setattr(copy, "PIECE_BYTES", 2**17)
    given, most = Correction(frequency_hz=5e5), 0.5 * traces.nbytes
    correct_dataset(tmp_path / "scan.h5", tmp_path / "warm.h5", given)
    assert peak_of(lambda: correct_dataset(tmp_path / "scan.h5", tmp_path / "new.h5", given)) < most


def breast(radius_m=0.11):
    """A ring with differences of at most 1.3 µs, as of a breast."""
    angle = 2.0 * np.pi * np.arange(32) / 32
    position = radius_m * np.column_stack((np.cos(angle), np.sin(angle)))
    distance = np.linalg.norm(position[:, None] - position[None], axis=-1)
    return Dataset(
        element_position_m=position,
        tx=np.arange(32),
        rx=np.arange(32),
        water_speed_mps=1500.0,
        delta_tof_s=-0.009 * distance / 1500.0,
        center_frequency_hz=5e5,
    )


@pytest.mark.parametrize("radius_m", [0.025, 0.11, 0.3])
def test_a_usual_scan_suggests_nothing(radius_m):
    assert propose(breast(radius_m), 4.2e5) == []
    assert propose(replace(breast(), delta_tof_s=np.zeros((32, 32))), None) == []


@pytest.mark.parametrize("factor", [0.1, 10.0])
def test_lengths_in_another_unit(factor):
    usual = breast()
    wrong = replace(usual, element_position_m=factor * usual.element_position_m)
    (proposal,) = propose(wrong, None)
    assert proposal.what == "positions"
    assert POSITION_UNITS[proposal.unit] / POSITION_UNITS[proposal.read_as] == pytest.approx(1.0 / factor)
    assert "220 mm are usual" in proposal.reason
    made = corrected(
        wrong, Correction(positions_in=proposal.unit, positions_read_as=proposal.read_as), "scan"
    )
    np.testing.assert_allclose(made.element_position_m, usual.element_position_m)


@pytest.mark.parametrize("contrast", [0.3, 1.0, 4.0])
@pytest.mark.parametrize("factor", [1e-3, 1e-6, 1e-9])
def test_times_in_another_unit(factor, contrast):
    usual = replace(breast(), delta_tof_s=contrast * breast().delta_tof_s)
    assert propose(usual, None) == []
    (proposal,) = propose(replace(usual, delta_tof_s=factor * usual.delta_tof_s), None)
    assert proposal.what == "times"
    assert TIME_UNITS[proposal.unit] / TIME_UNITS[proposal.read_as] == pytest.approx(1.0 / factor)


@pytest.mark.parametrize("factor", [1e3, 0.2])
def test_a_frequency_far_from_that_of_the_traces(factor):
    (proposal,) = propose(replace(breast(), center_frequency_hz=factor * 5e5), 4.9e5)
    assert (proposal.what, proposal.frequency_hz) == ("frequency", 4.9e5)
    assert "490 kHz" in proposal.reason
