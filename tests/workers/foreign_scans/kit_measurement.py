"""A small measurement as KIT 3D USCT stores it, by its access scripts (USCT_data_convert.m)."""

import zipfile
from pathlib import Path

import numpy as np
from scipy.io import savemat

ARRAYS, OF_ARRAY = 3, 4
SAMPLES, RATE_HZ = 300, 10e6
SPEED_MPS = 1480.0
# Emitting transducers: (array, element), from 1.
EMITTERS = ((1, 2), (2, 1), (3, 4))


def elements() -> np.ndarray:
    """(arrays, elements of an array, 3), m, on a hemisphere."""
    turn = 2.0 * np.pi * np.arange(ARRAYS * OF_ARRAY) * 0.381966
    height = np.linspace(0.1, 0.8, ARRAYS * OF_ARRAY)
    flat = np.sqrt(1.0 - height**2)
    position = 0.01 * np.column_stack((flat * np.cos(turn), flat * np.sin(turn), height))
    return position.reshape(ARRAYS, OF_ARRAY, 3)


def encode_float16(values: np.ndarray) -> np.ndarray:
    """Whole numbers in the 16-bit format of KIT; the inverse of ``decode_float16``, by its definition."""
    coded = []
    for value in np.ravel(values):
        exponent = 0
        while not -4096 <= value >> max(exponent - 1, 0) < 4096 or (
            exponent == 0 and not -2048 <= value < 2048
        ):
            exponent += 1
        mantissa = value >> max(exponent - 1, 0)
        coded.append((value < 0) << 15 | exponent << 11 | mantissa & 2047)
    return np.array(coded, np.uint16).view(np.int16).reshape(np.shape(values))


def excitation() -> np.ndarray:
    """A chirp at the sampling rate."""
    time = np.arange(60) / RATE_HZ
    return np.sin(2 * np.pi * (1.5e6 * time + 0.5 * 2e6 / time[-1] * time**2)) * np.hanning(60)


def arrivals(moved: np.ndarray) -> np.ndarray:
    """(emitters, receivers), samples."""
    flat = moved.reshape(-1, 3)
    sources = np.array([moved[tas - 1, one - 1] for tas, one in EMITTERS])
    return RATE_HZ * np.linalg.norm(sources[:, None] - flat[None], axis=-1) / SPEED_MPS


def write_measurement(folder: Path, delay: float = 0.0, *, second: bool = False, **changes: object) -> Path:
    """A measurement of generation III, or with ``second`` of II, whose emitters are other than its receivers.

    Each A-scan is the chirp at its arrival, times its amplification; the first receiver of the first emission
    is not recorded.
    """
    folder.mkdir(parents=True)
    position = elements()
    names = ("receiverPositions", "emitterPositions") if second else ("transducerPositions",)
    made = np.empty((1, ARRAYS), dtype=[(name, "O") for name in names])
    for k in range(ARRAYS):
        for name in names:
            made[name][0, k] = position[k] * (-1.0 if name == "emitterPositions" else 1.0)
    savemat(folder / "geometry.mat", {"TASElements": made})
    info = {"Hardware": "USCT3dv2" if second else "USCT3dv3", "AScanDatatype": "float16"}
    savemat(folder / "info.mat", info | {"Bandpassundersampling": 0.0})
    savemat(folder / "CE.mat", {"CE": excitation()[None], "CE_SF": RATE_HZ})
    savemat(folder / "TASTemp.mat", {"TASTemperature": np.full((1, ARRAYS, 2), 25.0)})
    savemat(folder / "Movements.mat", {"MovementsListreal": np.array([[90.0, 0.02], [0.0, 0.0]])})
    tas, receiver = (k.ravel() + 1 for k in np.indices((ARRAYS, OF_ARRAY)))
    sources = position * (-1.0 if second else 1.0)
    for number, (array, one) in enumerate(EMITTERS):
        distance = np.linalg.norm(position.reshape(-1, 3) - sources[array - 1, one - 1], axis=1)
        at = np.rint(RATE_HZ * distance / SPEED_MPS + delay).astype(int)
        gain = np.linspace(1.0, 2.0, len(tas))
        traces = np.zeros((SAMPLES, len(tas)))
        for k, begin in enumerate(at):
            traces[begin : begin + 60, k] = 5000 * gain[k] * excitation()
        some = slice(1, None) if number == 0 else slice(None)
        path = folder / f"TAS{array:03d}" / "TASRotation01" / f"Emitter{one:02d}.mat"
        path.parent.mkdir(parents=True)
        held = {
            "AScans": encode_float16(np.rint(traces).astype(int))[:, some],
            "TASIndices": tas[some, None].astype(float),
            "receiverIndices": receiver[some, None].astype(float),
            "Amplification": gain[some, None],
        } | changes
        savemat(path, {name: value for name, value in held.items() if value is not None})
    return folder


def zipped(folder: Path, target: Path) -> Path:
    """The measurement as a zip."""
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as archive:
        for path in sorted(folder.rglob("*.mat")):
            archive.write(path, path.relative_to(folder).as_posix())
    return target
