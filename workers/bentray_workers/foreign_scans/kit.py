"""Measurements of KIT 3D USCT II and III: a folder, or a zip of it, of MATLAB files.

Source:
    ``USCT_data_convert.m`` of github.com/KIT-3DUSCT/3D-USCT-III-access-script, and that of USCT II; the
    description of the data at the USCT data challenge of KIT.
"""

import math
import re
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bentray_kernels.errors import InvalidInput

from ..files.bounded_reading import LARGEST_ROW
from ..files.damage import rejecting_damage
from ..files.zip_checks import WHOLE, check_zip, member_file, naming
from .arrays import StreamedScan, Traces, read_small
from .kit_signals import RATE_HZ, UNDERSAMPLING, compress, decode_float16, reconstruct_undersampled
from .matlab import Matlab5
from .open_scan import OpenScan, ScanReader, Variable

# The path of the A-scans of an emission; the aperture position is ``TASRotation``.
EMISSION = re.compile(
    r"(?P<root>.*/)?TAS(?P<tas>\d{3})/TASRotation(?P<place>\d{2})/Emitter(?P<one>\d{2})\.mat"
)
# Folders of the measurement with the object and of the empty one.
OBJECT, EMPTY = ("object/", ""), ("water/", "empty/")
INFO = ("Hardware", "AScanDatatype", "Bandpassundersampling")
TEMPERATURES = ("TASTempComp.mat", "TASTemp.mat")
# Delay of the electronics, s.
DELAY_S = 2e-6
CENTER_HZ = 2.5e6
# Receivers whose traces are computed together.
AT_ONCE = 128
MAX_SAMPLES = 32_768
MAX_FILES = 65_536
# Of a file with descriptions, of which single variables are read whole.
LARGEST_DESCRIPTION = 64 * 2**20


class MeasurementFolder:
    """The MATLAB files of a measurement by their paths.

    Args:
        scan: an open zip or folder.

    Raises:
        InvalidInput: for too many files, or a damaged zip.
    """

    def __init__(self, scan: OpenScan) -> None:
        self._scan = scan
        if scan.archive is not None:
            with rejecting_damage("file", WHOLE):
                check_zip(scan.archive, MAX_FILES)
        if len(scan.members) > MAX_FILES:
            raise InvalidInput("file", f"{len(scan.members)} files", f"at most {MAX_FILES}")
        self.names = scan.members

    @contextmanager
    def opened(self, name: str) -> Iterator[Matlab5]:
        """The plain arrays of a file."""
        with self._path(name, LARGEST_ROW) as path, naming(name):
            yield Matlab5(path)

    def description(self, name: str, variables: tuple[str, ...]) -> dict[str, Any]:
        """Some variables of a small file, also texts and structures; absent ones are left out.

        Of an absent file these are all.
        """
        from scipy.io import loadmat

        if name not in self.names:
            return {}
        with self._path(name, LARGEST_DESCRIPTION) as path, rejecting_damage(name, "a MATLAB 5 file"):
            loaded = loadmat(path, variable_names=list(variables), appendmat=False, chars_as_strings=True)
        return {variable: loaded[variable] for variable in variables if variable in loaded}

    @contextmanager
    def _path(self, name: str, most: int) -> Iterator[Path]:
        """A file on disk, extracted up to ``most`` bytes."""
        archive: zipfile.ZipFile | None = self._scan.archive
        if archive is None:
            assert self._scan.folder is not None
            path = self._scan.folder / name
            if path.stat().st_size > most:
                raise InvalidInput(name, f"{path.stat().st_size} bytes", f"at most {most}")
            yield path
            return
        with member_file(archive, name, most, self._scan.scratch) as path:
            yield path


class _Emission(NamedTuple):
    """The file of one emission: transducer array (TAS) and emitter, counted from 1."""

    name: str
    tas: int
    emitter: int


class Measurement:
    """One measurement at its first aperture position: elements, emissions and traces.

    Attributes:
        position: (elements, 3), m: receivers, then emitters if these are other elements.
        tx: (ntx,), element of each emission.
        rx: (nrx,), elements that received in any emission.
        samples: of a trace at ``RATE_HZ``.
        valid: (ntx, nrx), pairs that were recorded.
        temperature_c: mean of the sensors; None if unknown.
        positions: number of aperture positions in the files.
    """

    def __init__(self, files: MeasurementFolder, root: str) -> None:
        self._files, self._root = files, root
        self._info = files.description(f"{root}info.mat", INFO)
        listed = sorted(
            (int(match["place"]), int(match["tas"]), int(match["one"]), match[0])
            for match in map(EMISSION.fullmatch, files.names)
            if match is not None and (match["root"] or "") == root
        )
        self.positions = len({index for index, *_ in listed})
        self._emissions = [
            _Emission(name, tas, emitter) for index, tas, emitter, name in listed if index == listed[0][0]
        ]
        receivers, emitters = self._geometry()
        apart = emitters is not receivers
        elements = np.concatenate((*receivers, *(emitters if apart else [])))
        self.position = self._moved(elements, listed[0][0])
        first = np.cumsum([0, *map(len, receivers), *(map(len, emitters) if apart else ())])
        self._first = first
        offset = len(receivers) if apart else 0
        for name, tas, emitter in self._emissions:
            if not 1 <= tas <= len(emitters) or not 1 <= emitter <= len(emitters[tas - 1]):
                raise InvalidInput(name, f"emitter {emitter} of TAS {tas}", "an emitter of the geometry")
        self.tx = np.array([first[offset + tas - 1] + emitter - 1 for _, tas, emitter in self._emissions])
        self._receivers = receivers
        columns = [self._columns(emission) for emission in self._emissions]
        self.rx = np.unique(np.concatenate([elements for elements, _ in columns]))
        self.valid = np.array([np.isin(self.rx, elements) for elements, _ in columns])
        self._recorded = {samples for _, samples in columns}
        if len(self._recorded) != 1:
            raise InvalidInput("AScans", f"{sorted(self._recorded)} samples", "as many in every emission")
        (recorded,) = self._recorded
        self._undersampled = _number(self._info, "Bandpassundersampling") == 1.0
        self.samples = UNDERSAMPLING * (recorded + recorded % 2) if self._undersampled else recorded
        self.temperature_c = self._temperature(listed[0][0])
        self._excitation = self._code()

    def traces(self) -> Iterator[NDArray[np.float32]]:
        """The (nrx, samples) traces of each emission; zeros where none was recorded."""
        for emission in self._emissions:
            with self._files.opened(emission.name) as arrays:
                elements = self._elements(arrays, emission.name)
                coded = _matrix(arrays, "AScans")
                gain = read_small(arrays, "Amplification", "numbers, one a column of AScans")
            gain = np.ones(len(elements)) if gain is None else np.asarray(gain, dtype=np.float64).ravel()
            if len(gain) != len(elements) or not (np.isfinite(gain) & (gain != 0.0)).all():
                raise InvalidInput(f"{emission.name}: Amplification", f"{len(gain)} numbers", "one a column")
            rows = np.searchsorted(self.rx, elements)
            traces = np.zeros((len(self.rx), self.samples), dtype=np.float32)
            is_float = self._is_float16(emission.name)
            for begin in range(0, len(elements), AT_ONCE):
                block = slice(begin, begin + AT_ONCE)
                values = decode_float16(coded[block]) if is_float else coded[block]
                values = np.asarray(values, dtype=np.float64) / gain[block, None]
                if self._undersampled:
                    values = reconstruct_undersampled(values)
                traces[rows[block]] = compress(values, self._excitation)
            yield traces

    def _geometry(self) -> tuple[list[NDArray[Any]], list[NDArray[Any]]]:
        """Positions of receivers and emitters of each TAS, (n, 3) each; one list if they are the same."""
        for name in sorted(self._files.names):
            folder, _, leaf = name.rpartition("/")
            if not leaf.endswith(".mat") or folder not in (self._root.rstrip("/"), ""):
                continue
            stored = self._files.description(name, ("TASElements",)).get("TASElements")
            if stored is None:
                continue
            fields = stored.dtype.names or ()
            if "transducerPositions" in fields:
                both = _positions(stored, "transducerPositions", name)
                return both, both
            if {"receiverPositions", "emitterPositions"} <= {*fields}:
                kinds = ("receiverPositions", "emitterPositions")
                return _positions(stored, kinds[0], name), _positions(stored, kinds[1], name)
            accepted = "transducerPositions, or receiverPositions and emitterPositions"
            raise InvalidInput(f"{name}: TASElements", f"the fields {', '.join(fields)}"[:120], accepted)
        accepted = (
            "the file of the geometry, with TASElements, beside info.mat; it comes with the access script"
        )
        raise InvalidInput("TASElements", "nothing", accepted)

    def _moved(self, elements: NDArray[np.float64], position: int) -> NDArray[np.float64]:
        """Elements at an aperture position: lifted along z and turned about it."""
        name = f"{self._root}Movements.mat"
        if name not in self._files.names:
            return elements
        moves = self._files.description(name, ("MovementsListreal",)).get("MovementsListreal")
        if moves is None or moves.dtype.kind not in "iuf" or moves.ndim != 2 or moves.shape[1] < 2:
            raise InvalidInput(f"{name}: MovementsListreal", "no list", "(positions, 2) rotations and lifts")
        if not 1 <= position <= len(moves) or not np.isfinite(moves[position - 1, :2]).all():
            return elements
        angle, lift = np.deg2rad(float(moves[position - 1, 0])), float(moves[position - 1, 1])
        cosine, sine = math.cos(angle), math.sin(angle)
        turn = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
        return np.asarray((elements + np.array([0.0, 0.0, lift])) @ turn.T)

    def _temperature(self, position: int) -> float | None:
        for leaf in TEMPERATURES:
            values = self._described(leaf, "TASTemperature").get("TASTemperature")
            if values is not None and values.dtype.kind == "f" and values.size:
                here = values[..., min(position, values.shape[-1]) - 1] if values.ndim == 3 else values
                finite = here[np.isfinite(here)]
                return float(finite.mean()) if finite.size else None
        return None

    def _code(self) -> NDArray[np.float64] | None:
        """The coded excitation at ``RATE_HZ``: measured, or as defined; None if there is none."""
        code = self._described("CEMeasured.mat", "CEMeasured").get("CEMeasured")
        if code is not None and code.dtype.kind in "iuf" and code.ndim == 2:
            columns = code if code.shape[0] > 1 else code.T
            is_float = _text(self._info, "AScanDatatype") == "float16" and columns.dtype.kind in "iu"
            values = decode_float16(columns) if is_float else columns
            rows = np.asarray(values, dtype=np.float64).T
            rows = reconstruct_undersampled(rows) if self._undersampled else rows
            return np.asarray(rows.mean(axis=0)[:MAX_SAMPLES])
        variables = self._described("CE.mat", "CE", "CE_SF")
        code, rate = variables.get("CE"), _number(variables, "CE_SF")
        if code is None or code.dtype.kind not in "iuf" or not code.size or rate is None or rate <= 0.0:
            return None
        code = np.asarray(code, dtype=np.float64).ravel()[: MAX_SAMPLES * 16]
        at = np.arange(0.0, (len(code) - 1) / rate, 1.0 / RATE_HZ)[:MAX_SAMPLES]
        return np.asarray(np.interp(at, np.arange(len(code)) / rate, code))

    def _described(self, leaf: str, *variables: str) -> dict[str, Any]:
        """Variables of a file of this measurement; see ``MeasurementFolder.description``."""
        return self._files.description(f"{self._root}{leaf}", variables)

    def _columns(self, emission: _Emission) -> tuple[NDArray[np.int64], int]:
        """Elements of the columns of an emission, and its number of samples."""
        with self._files.opened(emission.name) as arrays:
            declared = arrays.declared("AScans")
            elements = self._elements(arrays, emission.name)
        shape = () if declared is None else declared[0]
        if len(shape) != 2 or shape[0] != len(elements) or not 2 <= shape[1] <= MAX_SAMPLES:
            accepted = f"(samples, {len(elements)}), at most {MAX_SAMPLES} samples"
            raise InvalidInput(f"{emission.name}: AScans", f"shape {shape[::-1]}", accepted)
        return elements, shape[1]

    def _elements(self, arrays: Matlab5, name: str) -> NDArray[np.int64]:
        """Receiving elements of the columns of a file."""
        listed = []
        for variable in ("TASIndices", "receiverIndices"):
            values = read_small(arrays, variable, "integers, one a column of AScans")
            if values is None:
                raise InvalidInput(f"{name}: {variable}", "nothing", "integers, one a column of AScans")
            listed.append(np.asarray(values, dtype=np.int64).ravel())
        tas, receiver = listed
        if tas.shape != receiver.shape or not tas.size:
            raise InvalidInput(f"{name}: receiverIndices", f"shape {receiver.shape}", f"shape {tas.shape}")
        counts = np.array([len(receivers) for receivers in self._receivers])
        wrong = (tas < 1) | (tas > len(counts)) | (receiver < 1)
        wrong |= receiver > counts[np.clip(tas - 1, 0, len(counts) - 1)]
        if wrong.any():
            k = int(np.flatnonzero(wrong)[0])
            given = f"receiver {receiver[k]} of TAS {tas[k]}"
            raise InvalidInput(f"{name}: receiverIndices", given, "a receiver of the geometry, from 1")
        return np.asarray(self._first[tas - 1] + receiver - 1, dtype=np.int64)

    def _is_float16(self, name: str) -> bool:
        own = self._files.description(name, ("AScanDatatype",))
        return "float16" in (_text(own, "AScanDatatype"), _text(self._info, "AScanDatatype"))


def _matrix(arrays: Matlab5, name: str) -> NDArray[Any]:
    declared = arrays.declared(name)
    assert declared is not None
    if math.prod(declared[0]) * declared[1].itemsize > LARGEST_ROW:
        raise InvalidInput(name, f"shape {declared[0]}", f"at most {LARGEST_ROW} bytes")
    return arrays.whole(name)


def _positions(elements: NDArray[Any], name: str, file: str) -> list[NDArray[Any]]:
    positions = [np.asarray(of_tas) for of_tas in elements[name].ravel()]
    if any(of_tas.dtype.kind != "f" or of_tas.ndim != 2 or of_tas.shape[1] != 3 for of_tas in positions):
        raise InvalidInput(f"{file}: TASElements.{name}", "no positions", "(n, 3) numbers in m for every TAS")
    return [of_tas.astype(np.float64) for of_tas in positions]


def _number(variables: dict[str, Any], name: str) -> float | None:
    value = variables.get(name)
    return (
        float(value.ravel()[0]) if value is not None and value.dtype.kind in "iufb" and value.size else None
    )


def _text(variables: dict[str, Any], name: str) -> str:
    value = variables.get(name)
    return str(value.ravel()[0]) if value is not None and value.dtype.kind == "U" and value.size else ""


def _roots(names: frozenset[str]) -> list[str]:
    """Folders with A-scans and ``info.mat``."""
    roots = {match["root"] or "" for match in map(EMISSION.fullmatch, names) if match is not None}
    return sorted(root for root in roots if f"{root}info.mat" in names)


def _detect(scan: OpenScan) -> bool:
    return bool(_roots(scan.members))


def _read(scan: OpenScan) -> StreamedScan:
    files = MeasurementFolder(scan)
    roots = _roots(files.names)
    empty = next((root for root in roots if root.endswith(EMPTY)), None)
    others = [root for root in roots if root != empty]
    if len(others) != 1:
        accepted = "one measurement, and an empty one in a folder named water or empty"
        raise InvalidInput("file", f"{len(others)} measurements: {', '.join(others)}"[:160], accepted)
    record = Measurement(files, others[0])
    shape = (len(record.tx), len(record.rx), record.samples)
    traces = {"waveform/object": Traces(shape, np.dtype(np.float32), record.traces)}
    if empty is not None:
        water = Measurement(files, empty)
        same = np.array_equal(water.tx, record.tx) and np.array_equal(water.rx, record.rx)
        if not same or water.samples != record.samples or not np.allclose(water.position, record.position):
            given = f"{len(water.tx)} emissions, {len(water.rx)} receivers, {water.samples} samples"
            accepted = f"those of the object: {shape[0]}, {shape[1]} and {shape[2]}, at the same places"
            raise InvalidInput(empty.rstrip("/"), given, accepted)
        traces["waveform/water"] = Traces(shape, np.dtype(np.float32), water.traces)
        record.valid &= water.valid
    small: dict[str, Any] = {
        "geometry/element_position_m": record.position,
        "acquisition/tx": record.tx,
        "acquisition/rx": record.rx,
        "acquisition/sampling_rate_hz": RATE_HZ,
        "acquisition/center_frequency_hz": CENTER_HZ,
        "acquisition/t0_s": DELAY_S,
        "mask/valid": record.valid,
        "water/temperature_c": record.temperature_c,
    }
    several = f", aperture position 1 of {record.positions}" if record.positions > 1 else ""
    return StreamedScan(f"KIT 3D USCT{several}", small, traces)


READER = ScanReader(
    title="KIT 3D USCT II and III (folder or zip)",
    about="A folder of MATLAB 5 files, or a zip of it, as `USCT_data_convert.m` in "
    "github.com/KIT-3DUSCT/3D-USCT-III-access-script reads it, with the file of the geometry of that "
    "script beside `info.mat`. The empty measurement is a second such folder, named `water` or `empty`, "
    "beside that of the object. The first aperture position is read. A-scans are decoded, reconstructed "
    "at 10 MHz if they are undersampled, divided by their amplification, and compressed with the coded "
    "excitation; time zero is the delay of 2 µs in that script, the centre frequency 2.5 MHz. The scan "
    "is in space, and reconstructed as a volume.",
    variables=(
        Variable("TASttt/TASRotationpp/Emitteree.mat: AScans", "(samples, n) int16", "any", "A-scans"),
        Variable("TASIndices, receiverIndices", "(n,), from 1", "", "receiver of each A-scan"),
        Variable("Amplification", "(n,)", "1", "gain of each A-scan", "no"),
        Variable("AScanDatatype", "text", "", "float16: the format of KIT; also in info.mat", "no"),
        Variable(
            "info.mat: Bandpassundersampling", "number", "", "1: sampled at 10/3 MHz, else at 10 MHz", "no"
        ),
        Variable(
            "*.mat: TASElements",
            "structure: transducerPositions, or receiverPositions and emitterPositions, (n, 3)",
            "m",
            "elements of each TAS",
        ),
        Variable("Movements.mat: MovementsListreal", "(positions, 2)", "°, m", "rotation and lift", "no"),
        Variable("TASTempComp.mat, TASTemp.mat: TASTemperature", "(1, TAS, positions)", "°C", "water", "no"),
        Variable("CEMeasured.mat, or CE.mat: CE, CE_SF", "(n,), Hz", "any", "coded excitation", "no"),
    ),
    detect=_detect,
    read=_read,
)
