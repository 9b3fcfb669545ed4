"""Foreign scans become canonical files with the same numbers; invalid values are named."""

import io
import pickle
import struct
import zipfile
import zlib
from pathlib import Path

import h5py
import numpy as np
import pytest
from scipy.io import savemat

from bentray_kernels.acquisition import speed_from_temperature
from bentray_kernels.errors import InvalidInput
from bentray_workers.files.dataset import read_dataset, write_dataset
from bentray_workers.foreign_scans import convert_dataset
from bentray_workers.foreign_scans.matlab import Matlab5

from ...kernels.acquisition.traces import scan
from ...memory_program import peak_of
from .scans import (
    ELEMENTS,
    RATE_HZ,
    SAMPLES,
    T0_S,
    delta_tof,
    positions,
    refused,
    traces,
    travel_times,
    waveforms,
    write_matlab73,
)

WRITERS = {
    "matlab5": lambda path, variables: savemat(path, variables),
    "matlab5-packed": lambda path, variables: savemat(path, variables, do_compression=True),
    "matlab73": write_matlab73,
    "hdf5": lambda path, variables: write_matlab73(path, variables, header=False),
}
every_matlab = pytest.mark.parametrize("write", WRITERS.values(), ids=WRITERS)


def converted(tmp_path: Path, source: Path):
    told = convert_dataset(source, tmp_path / "canonical.h5")
    return told, read_dataset(tmp_path / "canonical.h5")


def named(dataset) -> dict[str, np.ndarray]:
    return {
        "geometry/element_position_m": dataset.element_position_m,
        "acquisition/tx": dataset.tx,
        "acquisition/rx": dataset.rx,
        "acquisition/sampling_rate_hz": np.array(dataset.sampling_rate_hz),
        "acquisition/center_frequency_hz": np.array(dataset.center_frequency_hz),
        "acquisition/t0_s": np.array(dataset.t0_s),
        "water/sound_speed_mps": np.array(dataset.water_speed_mps),
        "waveform/object": dataset.waveform.object,
        "waveform/water": dataset.waveform.water,
    }


@every_matlab
def test_travel_times_of_matlab_come_through(tmp_path, write):
    write(tmp_path / "scan.bin", travel_times())
    told, dataset = converted(tmp_path, tmp_path / "scan.bin")
    np.testing.assert_array_equal(dataset.delta_tof_s, delta_tof())
    np.testing.assert_array_equal(dataset.element_position_m, positions())
    assert dataset.tx.tolist() == dataset.rx.tolist() == list(range(ELEMENTS))
    assert dataset.water_speed_mps == pytest.approx(speed_from_temperature(20.0))
    assert "20 °C assumed" in dataset.source
    assert told.picked
    assert told.waveform is None


@every_matlab
def test_traces_of_matlab_come_through(tmp_path, write):
    more = {"sound_speed_mps": 1500.0, "center_frequency_hz": 4.0e5, "full_dataset_water": 2.0 * traces()}
    write(
        tmp_path / "scan.bin",
        waveforms()
        | {name: np.atleast_2d(value) if np.ndim(value) == 0 else value for name, value in more.items()},
    )
    told, dataset = converted(tmp_path, tmp_path / "scan.bin")
    expected = traces().transpose(2, 1, 0).astype(np.float32)
    np.testing.assert_array_equal(dataset.waveform.object, expected)
    np.testing.assert_array_equal(
        dataset.waveform.water, (2.0 * traces()).transpose(2, 1, 0).astype(np.float32)
    )
    np.testing.assert_array_equal(dataset.element_position_m, positions())
    assert dataset.sampling_rate_hz == pytest.approx(RATE_HZ)
    assert dataset.t0_s == pytest.approx(T0_S)
    assert dataset.water_speed_mps == 1500.0
    assert dataset.center_frequency_hz == 4.0e5
    assert "assumed" not in dataset.source
    assert told.waveform.object.shape == (ELEMENTS, ELEMENTS, SAMPLES)
    assert told.waveform.object.strides == (0, 0, 0), "traces are not held"


@pytest.mark.parametrize("order", ["<", ">"])
def test_matlab_5_stores_whole_numbers_small_and_in_either_byte_order(tmp_path, order):
    """Doubles that are whole numbers are stored as bytes, which scipy does not write."""
    values = np.arange(ELEMENTS * ELEMENTS) % 200
    every = (2, np.arange(ELEMENTS, dtype="u1").tobytes())
    elements = b"".join(
        _element(order, name, shape, kind, data)
        for name, shape, kind, data in (
            ("log_ratio_np", (ELEMENTS, ELEMENTS), "f8", (2, values.astype("u1").tobytes())),
            ("delta_tof_s", (ELEMENTS, ELEMENTS), "f8", (2, bytes(ELEMENTS * ELEMENTS))),
            ("tx", (ELEMENTS,), "i4", every),
            ("rx", (ELEMENTS,), "i4", every),
            (
                "element_position_m",
                (ELEMENTS, 2),
                "f8",
                (9, positions().T.astype(order + "f8").tobytes()),
            ),
        )
    )
    header = b"MATLAB 5.0 MAT-file".ljust(124) + (b"\x00\x01IM" if order == "<" else b"\x01\x00MI")
    (tmp_path / "scan.mat").write_bytes(header + elements)
    _, dataset = converted(tmp_path, tmp_path / "scan.mat")
    np.testing.assert_array_equal(dataset.log_ratio_np, values.reshape(ELEMENTS, ELEMENTS).T)


def _element(order: str, name: str, shape: tuple[int, ...], kind: str, data: tuple[int, bytes]) -> bytes:
    def part(number: int, content: bytes) -> bytes:
        return struct.pack(order + "II", number, len(content)) + content + b"\x00" * (-len(content) % 8)

    flags = part(6, struct.pack(order + "II", {"f8": 6, "i4": 12, "struct": 2, "cell": 1}[kind], 0))
    dims = part(5, struct.pack(order + f"{len(shape)}i", *shape))
    body = flags + dims + part(1, name.encode()) + part(*data)
    return struct.pack(order + "II", 14, len(body)) + body


@pytest.mark.parametrize("save", [np.savez, np.savez_compressed])
@pytest.mark.parametrize("bare", [False, True])
def test_archives_of_plain_arrays_come_through(tmp_path, save, bare):
    made = scan(2e-7, elements=ELEMENTS)
    arrays = named(made)
    if bare:
        arrays = {
            name.rpartition("/")[2]: array for name, array in arrays.items() if name != "waveform/water"
        }
    with (tmp_path / "scan").open("wb") as file:
        save(file, **arrays)
    _, dataset = converted(tmp_path, tmp_path / "scan")
    np.testing.assert_array_equal(dataset.waveform.object, made.waveform.object)
    assert (dataset.waveform.water is None) == bare
    for name in ("element_position_m", "tx", "rx", "sampling_rate_hz", "t0_s", "water_speed_mps"):
        np.testing.assert_array_equal(getattr(dataset, name), getattr(made, name))


def test_an_archive_may_hold_times_masks_slices_and_a_truth(tmp_path):
    delta = np.stack([delta_tof(), 2 * delta_tof()])
    np.savez(
        tmp_path / "scan.npz",
        element_position_m=np.asfortranarray(positions()),
        tx=np.arange(ELEMENTS, dtype=np.uint8),
        rx=np.arange(ELEMENTS),
        delta_tof_s=delta,
        valid=np.isfinite(delta),
        z_m=[0.0, 0.01],
        temperature_c=25.0,
        **{
            "truth/sound_speed_mps": np.full((4, 5), 1500.0),
            "truth/spacing_m": 0.01,
            "truth/origin_m": [0.0, 0.0],
        },
    )
    _, dataset = converted(tmp_path, tmp_path / "scan.npz")
    np.testing.assert_array_equal(dataset.delta_tof_s, delta)
    assert dataset.slices == 2
    assert dataset.valid.dtype == bool
    assert dataset.water_speed_mps == pytest.approx(speed_from_temperature(25.0))
    assert dataset.truth.spacing_m == (0.01, 0.01)


def test_the_upload_format_itself_is_copied(tmp_path):
    made = scan(2e-7, elements=ELEMENTS)
    write_dataset(tmp_path / "scan.h5", made)
    _, dataset = converted(tmp_path, tmp_path / "scan.h5")
    np.testing.assert_array_equal(dataset.waveform.object, made.waveform.object)


@every_matlab
@pytest.mark.parametrize(
    ("variables", "field"),
    [
        (lambda: {"delta_tof": delta_tof()}, "element_positions"),
        (lambda: travel_times() | {"element_positions": positions().T}, "element_positions"),
        (lambda: travel_times() | {"delta_tof": delta_tof()[1:]}, "delta_tof"),
        (lambda: travel_times() | {"element_positions": 1e3 * positions()}, "geometry/element_position_m"),
        (lambda: travel_times() | {"delta_tof": np.full((8, 8), np.inf)}, "traveltime/delta_tof_s"),
        (lambda: travel_times() | {"temperature_c": np.array([[300.0]])}, "water@temperature_c"),
        (lambda: travel_times() | {"sound_speed_mps": np.ones((1, 2))}, "sound_speed_mps"),
        (lambda: {k: v for k, v in waveforms().items() if k != "full_dataset"}, "full_dataset"),
        (lambda: {k: v for k, v in waveforms().items() if k != "time"}, "time"),
        (lambda: waveforms() | {"time": waveforms()["time"] ** 2}, "time"),
        (lambda: waveforms() | {"full_dataset": traces()[:, :-1]}, "full_dataset"),
        (lambda: waveforms() | {"transducerPositionsXY": positions()}, "transducerPositionsXY"),
        (lambda: waveforms() | {"full_dataset_water": traces()[1:]}, "full_dataset_water"),
        (lambda: travel_times() | {"delta_tof": delta_tof() * 1j}, "delta_tof"),
    ],
)  # fmt: skip
def test_names_missing_or_invalid_input(tmp_path, write, variables, field):
    write(tmp_path / "scan.bin", variables())
    error = refused(tmp_path / "scan.bin")
    assert error.field == field
    assert error.accepted


@pytest.mark.parametrize(
    ("value", "what"),
    [
        ({"a": 1.0}, "a structure"),
        (np.array([[1.0], "x"], dtype=object), "a cell"),
        ("text", "text"),
        (np.eye(3) * 1j, "complex"),
    ],
)
@pytest.mark.parametrize("packed", [False, True])
def test_non_numeric_arrays_are_rejected_only_when_used(tmp_path, value, what, packed):
    savemat(tmp_path / "scan.mat", travel_times() | {"delta_tof": value}, do_compression=packed)
    refused(tmp_path / "scan.mat", f"delta_tof: found {what}")
    savemat(tmp_path / "scan.mat", travel_times() | {"notes": value}, do_compression=packed)
    assert convert_dataset(tmp_path / "scan.mat", tmp_path / "canonical.h5").picked


def test_pickles_in_archives_are_never_loaded(tmp_path):
    opened: list[str] = []

    class Trap:
        def __reduce__(self):
            return (opened.append, ("opened",))

    made = named(scan(elements=ELEMENTS))
    trap = np.empty((ELEMENTS, ELEMENTS), dtype=object)
    trap[:] = Trap()
    np.savez(tmp_path / "scan.npz", **(made | {"acquisition/tx": trap}), allow_pickle=True)
    with zipfile.ZipFile(tmp_path / "other.npz", "w") as archive:
        archive.writestr("geometry/element_position_m.npy", pickle.dumps(Trap()))
    for name in ("scan.npz", "other.npz"):
        refused(tmp_path / name)
    assert opened == []


def _header(shape: tuple[int, ...], dtype: str = "<f8") -> bytes:
    made = io.BytesIO()
    np.lib.format.write_array_header_1_0(made, {"descr": dtype, "fortran_order": False, "shape": shape})
    return made.getvalue()


@pytest.mark.parametrize(
    "shape", [(1 << 40, 2), (1 << 20, 1 << 10), (1 << 62, 1 << 62), (2,) * 30, (-1, 2), (50_000, 2)]
)
def test_an_archive_that_declares_more_than_it_holds_is_rejected_without_the_memory(tmp_path, shape):
    with zipfile.ZipFile(tmp_path / "scan.npz", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("element_position_m.npy", _header(shape) + bytes(800))
    assert peak_of(lambda: refused(tmp_path / "scan.npz")) < 8 << 20


def test_bombs_are_not_unpacked(tmp_path):
    """A gigabyte of zeros in some megabytes, in the place of positions, in both packed formats."""
    with (
        zipfile.ZipFile(tmp_path / "scan.npz", "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive,
        archive.open("element_position_m.npy", "w", force_zip64=True) as member,
    ):
        member.write(_header((1 << 26, 2)))
        for _ in range(64):
            member.write(bytes(1 << 24))
    packer = zlib.compressobj(1)
    size = 1 << 30
    head = _element("<", "element_positions", (1 << 26, 2), "f8", (9, b""))[:-8]
    head = struct.pack("<II", 14, size + 64) + head[8:] + struct.pack("<II", 9, size)
    body = (
        packer.compress(head) + b"".join(packer.compress(bytes(1 << 24)) for _ in range(64)) + packer.flush()
    )
    start = b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM"
    (tmp_path / "scan.mat").write_bytes(start + struct.pack("<II", 15, len(body)) + body)
    # SciPy unpacks 128 KiB of a file at once, at most 1032 times as much.
    for name, most in (("scan.npz", 32 << 20), ("scan.mat", 140 << 20)):
        assert peak_of(lambda name=name: refused(tmp_path / name)) < most


def test_flipped_bit_in_an_archive_fails_its_checksum(tmp_path):
    """Not compressed, so that a flip in the middle of the traces changes one value and nothing else."""
    np.savez(tmp_path / "scan.npz", **named(scan(2e-7, elements=ELEMENTS)))
    content = bytearray((tmp_path / "scan.npz").read_bytes())
    with zipfile.ZipFile(tmp_path / "scan.npz") as archive:
        traces_at = archive.getinfo("waveform/object.npy")
        content[traces_at.header_offset + traces_at.compress_size // 2] ^= 1
    (tmp_path / "scan.npz").write_bytes(content)
    refused(tmp_path / "scan.npz", r"waveform/object: found damaged data .*CRC")


@pytest.mark.parametrize("byte", [-1, -4])
def test_packed_numbers_of_matlab_have_a_check_sum_that_is_verified(tmp_path, byte):
    savemat(tmp_path / "scan.mat", {"delta_tof": travel_times()["delta_tof"]}, do_compression=True)
    packed = bytearray((tmp_path / "scan.mat").read_bytes())
    arrays = Matlab5(tmp_path / "scan.mat")
    assert arrays.whole("delta_tof").shape == (ELEMENTS, ELEMENTS)
    packed[byte] ^= 1
    (tmp_path / "scan.mat").write_bytes(packed)
    with pytest.raises(InvalidInput, match=r"(file|delta_tof): found damaged data"):
        Matlab5(tmp_path / "scan.mat").whole("delta_tof")


@pytest.mark.parametrize("stored", [0, 8, 14, 20, 60000])
@pytest.mark.parametrize("packed", [False, True])
def test_numbers_of_matlab_are_stored_as_numbers(tmp_path, stored, packed):
    """SciPy looks the type up without a check, and the process ends."""
    element = _element("<", "delta_tof", (2, 2), "f8", (stored, bytes(32)))
    if packed:
        element = zlib.compress(element)
        element = struct.pack("<II", 15, len(element)) + element
    (tmp_path / "scan.mat").write_bytes(b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM" + element)
    with pytest.raises(InvalidInput, match=f"file: found numbers stored as type {stored}; accepted"):
        Matlab5(tmp_path / "scan.mat")


def test_a_cell_that_says_that_it_is_logical_is_not_read(tmp_path):
    """SciPy names it logical, and its cells would be read."""
    element = bytearray(_element("<", "delta_tof", (2, 2), "cell", (9, bytes(32))))
    element[17] = 2
    (tmp_path / "scan.mat").write_bytes(b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM" + element)
    with pytest.raises(InvalidInput, match="delta_tof: found logical; accepted: a plain array"):
        Matlab5(tmp_path / "scan.mat").whole("delta_tof")


@pytest.mark.parametrize("kind", ["matlab5", "matlab5-packed", "matlab73", "npz"])
def test_damage_anywhere_is_rejected_and_never_crashes(tmp_path, kind):
    """Bytes changed at random and files cut short: a dataset, or InvalidInput; nothing else."""
    if kind == "npz":
        np.savez_compressed(tmp_path / "good", **named(scan(elements=4)))
        (tmp_path / "good.npz").rename(tmp_path / "good")
    else:
        WRITERS[kind](tmp_path / "good", waveforms())
    good = (tmp_path / "good").read_bytes()
    random = np.random.default_rng(7)
    refused = 0
    for trial in range(60):
        bad = bytearray(good)
        if trial % 3 == 0:
            del bad[int(random.integers(len(bad))) :]
        else:
            for at in random.integers(0, min(len(bad), 700 if trial % 3 == 1 else len(bad)), 4):
                bad[at] = int(random.integers(256))
        (tmp_path / "bad").write_bytes(bytes(bad))
        try:
            convert_dataset(tmp_path / "bad", tmp_path / "canonical.h5")
        except InvalidInput:
            refused += 1
    assert refused > 20


def test_an_external_link_is_not_followed(tmp_path):
    write_matlab73(tmp_path / "other.h5", {"delta_tof": delta_tof()}, header=False)
    write_matlab73(tmp_path / "scan.mat", {"element_positions": positions()}, header=False)
    with h5py.File(tmp_path / "scan.mat", "r+") as file:
        file["delta_tof"] = h5py.ExternalLink(str(tmp_path / "other.h5"), "delta_tof")
    refused(tmp_path / "scan.mat", "delta_tof: found a soft or external link")


def test_rejects_unknown_formats(tmp_path):
    np.savez(tmp_path / "scan.npz", something=np.arange(3))
    refused(tmp_path / "scan.npz", "a NumPy archive with the arrays something")
    (tmp_path / "scan.txt").write_text("no scan")
    refused(tmp_path / "scan.txt", r"not HDF5.*accepted: a scan in HDF5, MATLAB or NumPy")
