"""Volumes that are built to harm, in every format, with the field that each is to be refused for."""

import gzip
import io
import struct
from pathlib import Path
from typing import Any

import h5py
import nibabel
import numpy as np

RAMP = np.arange(60, dtype=np.uint8).reshape(3, 4, 5)
Given = dict[str, Any]


def npy(values: Any) -> bytes:
    buffer = io.BytesIO()
    np.save(buffer, values, allow_pickle=True)
    return buffer.getvalue()


def npy_header(text: str, values: bytes = b"") -> bytes:
    """A NumPy file with a header of one's own."""
    header = text.encode("latin-1") + b" " * (-(10 + len(text) + 1) % 64) + b"\n"
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header + values


def npy_shape(shape: str, dtype: str = "<f4") -> bytes:
    return npy_header(f"{{'descr': '{dtype}', 'fortran_order': False, 'shape': {shape}}}", bytes(64))


def nrrd(*fields: str, values: bytes = bytes(60), **changed: str | None) -> bytes:
    """An NRRD file of 3 by 4 by 5 bytes; ``fields`` are added, ``changed`` replaced, or left out for None."""
    told = {"type": "uint8", "dimension": "3", "sizes": "3 4 5", "encoding": "raw", **changed}
    lines = ["NRRD0004", *(f"{name}: {value}" for name, value in told.items() if value is not None), *fields]
    return "\n".join(lines).encode() + b"\n\n" + values


def nifti(change: dict[str, Any] | None = None, values: bytes | None = None) -> bytes:
    """A NIfTI file of ``RAMP`` with some entries of its header changed, and other values."""
    whole = nibabel.Nifti1Image(RAMP, np.diag([1.0, 1.0, 1.0, 1.0])).to_bytes()
    header = np.frombuffer(whole[:348], nibabel.Nifti1Header.template_dtype).copy()
    for name, value in (change or {}).items():
        header[name] = value
    return header.tobytes() + whole[348:352] + (whole[352:] if values is None else values)


def canonical(shape: tuple[int, ...] = (3, 4, 5), kind: str = "bentray-volume", **attributes: Any) -> bytes:
    """An HDF5 volume of ours."""
    buffer = io.BytesIO()
    told = {
        "format_version": "1.0",
        "spacing_m": [1e-3] * 3,
        "origin_m": [0.0] * 3,
        "title": "",
        **attributes,
    }
    with h5py.File(buffer, "w") as file:
        file.attrs.update(format=kind, **told)
        file.create_dataset("values", shape, "f4", chunks=True)
    return buffer.getvalue()


def bomb(start: bytes = b"") -> bytes:
    """A quarter of a gigabyte of zeros, packed, after ``start``: members of 1 MiB each."""
    zeros = bytes(2**20)
    return gzip.compress(start + zeros, 1, mtime=0) + 255 * gzip.compress(zeros, 1, mtime=0)


def spoilt(value: float, dtype: str = "f4") -> bytes:
    values = np.zeros((3, 4, 5), dtype)
    values[1, 2, 3] = value
    return npy(values)


UNPLACED = {"sform_code": 0, "qform_code": 0}
RAW = {"shape": [3, 4, 5], "dtype": "uint8"}
OBJECTS = npy(np.array([{"a": 1}, print], dtype=object))

# Name: the content, what the user says of it, and the field that its refusal names.
REFUSED: dict[str, tuple[bytes, Given, str]] = {
    "nothing": (b"", {}, "file"),
    "nothing known": (b"no volume at all", {}, "file"),
    "a pickle": (b"\x80\x04\x8c\x05posix\x94\x8c\x06system\x94\x93\x94.", {}, "file"),
    # NumPy.
    "pickled objects": (OBJECTS, {}, "values"),
    "objects in three dimensions": (npy_shape("(2, 2, 2)", "|O"), {}, "values"),
    "text": (npy(np.full((2, 2, 2), "x")), {}, "values"),
    "records": (npy(np.zeros((2, 2, 2), [("a", "f4")])), {}, "values"),
    "complex": (npy(np.zeros((2, 2, 2), complex)), {}, "values"),
    "dates": (npy(np.zeros((2, 2, 2), "M8[s]")), {}, "values"),
    "terabytes": (npy_shape("(1000000, 1000000, 4)"), {}, "values"),
    "more than fits into 64 bits": (npy_shape(f"({2**40}, {2**40}, 2)"), {}, "values"),
    "a negative size": (npy_shape("(-3, -4, 5)"), {}, "values"),
    "a size that is no number": (npy_shape("('a', 2, 2)"), {}, "file"),
    "no values": (npy_shape("(8, 8, 8)"), {}, "file"),
    "a header that is a program": (npy_header("__import__('os').system('true')"), {}, "file"),
    "a deep header": (npy_header("(" * 9000 + ")" * 9000), {}, "file"),
    "a header without an end": (b"\x93NUMPY\x01\x00\xff\xff{", {}, "file"),
    "a format of the future": (b"\x93NUMPY\x09\x00" + bytes(100), {}, "file"),
    "one axis": (npy(np.zeros(60)), {}, "values"),
    "four axes": (npy(np.zeros((2, 2, 2, 2))), {}, "values"),
    "an axis of nothing": (npy(np.zeros((3, 0, 5))), {}, "values"),
    "a plane": (npy(np.zeros((3, 4, 1))), {}, "values"),
    "a value that is none": (spoilt(np.nan), {}, "values"),
    "an endless value": (spoilt(-np.inf), {}, "values"),
    "beyond single precision": (spoilt(1e300, "f8"), {}, "values"),
    "a spacing that is none": (npy(RAMP), {"spacing_m": [np.nan]}, "spacing_m"),
    "a negative spacing": (npy(RAMP), {"spacing_m": [-1.0]}, "spacing_m"),
    "no spacing": (npy(RAMP), {"spacing_m": [0.0]}, "spacing_m"),
    "two spacings": (npy(RAMP), {"spacing_m": [1e-3, 1e-3]}, "spacing_m"),
    # Raw bytes.
    "too few bytes": (bytes(59), RAW, "file"),
    "too many bytes": (bytes(61), RAW, "file"),
    "raw without a type": (bytes(60), {"shape": [3, 4, 5]}, "dtype"),
    "raw without a shape": (bytes(60), {"dtype": "uint8"}, "shape"),
    "raw of one axis": (bytes(60), RAW | {"shape": [60]}, "shape"),
    "raw terabytes": (bytes(60), RAW | {"shape": [10**6, 10**6, 4]}, "shape"),
    "a raw negative size": (bytes(60), RAW | {"shape": [-3, -4, 5]}, "shape"),
    "raw objects": (bytes(480), RAW | {"dtype": "O"}, "dtype"),
    "raw of no type": (bytes(60), RAW | {"dtype": "uint8; rm"}, "dtype"),
    # NRRD.
    "a file beside it": (nrrd("data file: /etc/passwd"), {}, "data file"),
    "a list of files": (nrrd("data file: LIST", values=b"/etc/passwd\n"), {}, "data file"),
    "numbered files": (nrrd("datafile: /etc/%03d 1 5 1"), {}, "data file"),
    "skipped bytes": (nrrd("byte skip: -1"), {}, "byte skip"),
    "skipped lines": (nrrd("line skip: 100000000"), {}, "line skip"),
    "absurd sizes": (nrrd(sizes="1000000 1000000 1000"), {}, "sizes"),
    "negative sizes": (nrrd(sizes="-3 -4 5"), {}, "sizes"),
    "two sizes": (nrrd(sizes="3 4"), {}, "sizes"),
    "sizes without end": (nrrd(sizes="3 " * 20_000), {}, "sizes"),
    "no sizes": (nrrd(sizes=None), {}, "file"),
    "no type": (nrrd(type=None), {}, "file"),
    "blocks": (nrrd("block size: 8", type="block"), {}, "type"),
    "an unknown packing": (nrrd(encoding="bzip2"), {}, "encoding"),
    "hexadecimal": (nrrd(encoding="hex"), {}, "encoding"),
    "colours": (nrrd("kinds: RGB-color domain domain"), {}, "kinds"),
    "an NRRD cut short": (nrrd(values=bytes(10)), {}, "file"),
    "a packed NRRD that is no gzip": (nrrd(encoding="gzip"), {}, "file"),
    "a packed NRRD that is too short": (nrrd(encoding="gzip", values=gzip.compress(bytes(3))), {}, "file"),
    "a declared NRRD bomb": (nrrd(encoding="gzip", sizes="3 4 4000000000", values=b""), {}, "sizes"),
    "a header of NRRD without an end": (b"NRRD0004\n" + b"# nothing\n" * 200_000, {}, "file"),
    "one unit of inches": (nrrd("spacings: 1 1 1", 'units: "mm" "mm" "inch"'), {}, "units"),
    "an unknown unit": (nrrd("spacings: 1 1 1", 'units: "ell" "ell" "ell"'), {}, "units"),
    "spacings that are none": (nrrd("spacings: nan nan nan"), {}, "spacings"),
    "endless directions": (
        nrrd("space: LPS", "space directions: (inf,0,0) (0,1,0) (0,0,1)"),
        {},
        "spacing_m",
    ),
    # NIfTI.
    "absurd dims": (nifti({"dim": [3, 32767, 32767, 32767, 1, 1, 1, 1]}), {}, "dim"),
    "negative dims": (nifti({"dim": [3, -3, -4, 5, 1, 1, 1, 1]}), {}, "dim"),
    "no dims": (nifti({"dim": [0] * 8}), {}, "dim"),
    "too many dims": (nifti({"dim": [99] + [2] * 7}), {}, "file"),
    "RGB": (nifti({"datatype": 128, "bitpix": 24}), {}, "dim"),
    "complex NIfTI": (nifti({"datatype": 32, "bitpix": 64}), {}, "dim"),
    "an unknown type": (nifti({"datatype": 9999}), {}, "file"),
    "values far away": (nifti({"vox_offset": 1e30}), {}, "vox_offset"),
    "values before the beginning": (nifti({"vox_offset": -400.0}), {}, "file"),
    "an offset that is none": (nifti({"vox_offset": np.nan}), {}, "file"),
    "a NIfTI cut short": (nifti(values=bytes(10)), {}, "file"),
    "a scale without end": (nifti({"scl_slope": np.float32(3e38), "scl_inter": 3e38}), {}, "values"),
    "a grid of nothing": (nifti({"sform_code": 1, "srow_x": [0, 0, 0, 0]}), {}, "spacing_m"),
    "a sheared grid": (nifti({"sform_code": 1, "srow_x": [1, 0.9, 0, 0]}), {}, "affine"),
    "a grid without end": (nifti({"sform_code": 1, "srow_x": [1, 0, 0, np.inf]}), {}, "origin_m"),
    "a value of NIfTI that is none": (nifti({"datatype": 16, "bitpix": 32}, b"\xff" * 240), {}, "values"),
    "spacing without end": (nifti(UNPLACED | {"pixdim": [1, np.inf, 1, 1, 0, 0, 0, 0]}), {}, "spacing_m"),
    "a packed NIfTI cut short": (gzip.compress(nifti())[:-40], {}, "file"),
    "a packed file of another kind": (gzip.compress(b"x" * 1000), {}, "file"),
    "a bomb": (bomb(), {}, "file"),
    "a bomb behind a header": (bomb(nifti({"dim": [3, 16384, 16384, 2, 1, 1, 1, 1]})), {}, "file"),
    "packed twice": (gzip.compress(gzip.compress(nifti())), {}, "file"),
    # HDF5.
    "an absurd HDF5": (canonical((2**40, 2**10, 2**10)), {}, "values"),
    "an HDF5 that stores nothing": (canonical((2**8, 2**9, 2**8)), {}, "values"),
    "another HDF5": (canonical(kind="uct-transmission"), {}, "@format"),
    "an HDF5 of the future": (canonical(format_version="2.0"), {}, "@format_version"),
    "an HDF5 without spacing": (canonical(spacing_m="none"), {}, "@spacing_m"),
    "an HDF5 far away": (canonical(origin_m=[np.inf, 0, 0]), {}, "origin_m"),
}


def files(folder: Path) -> dict[str, tuple[Path, Given]]:
    """Write every volume of this module."""
    written = {}
    for number, (name, (content, given, _)) in enumerate(REFUSED.items()):
        path = folder / f"volume-{number}"
        path.write_bytes(content)
        written[name] = path, given
    return written
