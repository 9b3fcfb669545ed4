"""Reading NRRD: the header by pynrrd, the values here, since pynrrd decompresses without bound."""

import gzip
import math
import re
from collections.abc import Sequence
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from bentray_kernels.arrays import Floats
from bentray_kernels.errors import InvalidInput

from .bounded_reading import UNITS_M, ShapeCheck, any_shape, at_end, declared, whole
from .damage import rejecting_damage
from .npy_headers import LONGEST_HEADER
from .volume_axes import PositionedImage, reorient

NRRD_TYPES = {
    "i1": ("signed char", "int8", "int8_t"),
    "u1": ("uchar", "unsigned char", "uint8", "uint8_t"),
    "i2": ("short", "short int", "signed short", "signed short int", "int16", "int16_t"),
    "u2": ("ushort", "unsigned short", "unsigned short int", "uint16", "uint16_t"),
    "i4": ("int", "signed int", "int32", "int32_t"),
    "u4": ("uint", "unsigned int", "uint32", "uint32_t"),
    "i8": ("longlong", "long long", "signed long long", "int64", "int64_t"),
    "u8": ("ulonglong", "unsigned long long", "uint64", "uint64_t"),
    "f4": ("float",),
    "f8": ("double",),
}


# Header fields of values stored elsewhere.
ELSEWHERE = ("data file", "byte skip", "line skip")
# Fields of two words may be written as one; they and their synonyms have the names that pynrrd knows.
FIELDS = {
    name.replace(" ", ""): name
    for name in (*ELSEWHERE, "axis mins", "axis maxs", "space dimension", "space directions", "space origin")
} | {"spaceunits": "space units", "centers": "centerings"}
# Fields with one value for each axis.
PER_AXIS = ("spacings", "thicknesses", "axis mins", "axis maxs", "centerings", "kinds", "space directions")
# Signs of the axes of each space relative to RAS; spaces without a body are taken as RAS.
SPACES = {
    "right-anterior-superior": (1.0, 1.0, 1.0),
    "left-anterior-superior": (-1.0, 1.0, 1.0),
    "left-posterior-superior": (-1.0, -1.0, 1.0),
    "scanner-xyz": (1.0, 1.0, 1.0),
    "3d-right-handed": (1.0, 1.0, 1.0),
}
SHORT = {"ras": "right-anterior-superior", "las": "left-anterior-superior", "lps": "left-posterior-superior"}
# Of a spacing: two statements that differ by more contradict each other.
AGREE = 1e-3


def nrrd_image(file: IO[bytes], check: ShapeCheck = any_shape, least: int = 2) -> PositionedImage:
    """The image in an NRRD file with attached values.

    Its axes go to the right, front and head if the space of the file is anatomical, as ``LPS``; otherwise
    they are in the order and direction of that space.

    Args:
        file: at its beginning; it is read to its end.
        check: called with the shape before the values are read.
        least: nodes along each axis; 1 accepts planes.

    Raises:
        InvalidInput: for other files, and where positions are stated in part, twice, or not as in ``SPACES``.

    Source:
        "Definition of NRRD File Format", teem.sourceforge.net/nrrd/format.html.
    """
    import nrrd

    start = file.read(LONGEST_HEADER)
    # The header ends with an empty line.
    ends = [start.find(mark) + len(mark) for mark in (b"\n\n", b"\r\n\r\n") if mark in start]
    if not ends:
        raise InvalidInput("file", "an NRRD header without an end", f"one of at most {LONGEST_HEADER} bytes")
    accepted = "a whole NRRD file in three dimensions"
    with rejecting_damage("file", accepted):
        header: Any = nrrd.read_header(_named_fields(start[: min(ends)]))
        # A detached data file could be any file of this machine; its name is not repeated.
        for field in ELSEWHERE:
            if header.get(field):
                raise InvalidInput(field, "values elsewhere", "values in the same file, after the header")
        kinds = set(header.get("kinds", ())) - {"domain", "space", "none", "???"}
        if kinds:
            raise InvalidInput("kinds", ", ".join(sorted(kinds)), "domain or space along each axis")
        dtype = next((np.dtype(code) for code, names in NRRD_TYPES.items() if header["type"] in names), None)
        if dtype is None:
            raise InvalidInput("type", repr(header["type"]), "a type of numbers")
        endian = str(header.get("endian", "little" if dtype.itemsize == 1 else None)).lower()
        if endian not in ("little", "big"):
            raise InvalidInput("endian", "none" if endian == "none" else repr(endian), "little or big")
        dtype = dtype.newbyteorder(">" if endian == "big" else "<")
        shape = tuple(int(n) for n in header["sizes"])
        stored = (*shape, 1) if least == 1 and len(shape) == 2 else shape
        count = declared("sizes", stored, dtype, check, least)
        if header["dimension"] != len(shape):
            raise InvalidInput("dimension", header["dimension"], f"{len(shape)}, as many as there are sizes")
        for name in PER_AXIS:
            if name in header and len(header[name]) != len(shape):
                raise InvalidInput(name, f"{len(header[name])} of them", f"{len(shape)}, one for each axis")
        file.seek(min(ends))
        encoding = header["encoding"]
        if encoding == "raw":
            data = whole(file, count)
            at_end(file)
        elif encoding in ("gzip", "gz"):
            with gzip.open(file) as unpacked:
                data = whole(unpacked, count)
                at_end(unpacked)
        else:
            raise InvalidInput("encoding", repr(encoding), "raw or gzip")
        values = np.frombuffer(data, dtype).reshape(stored, order="F")
        grid = reorient(values, _affine(header, shape), "space directions")
        return PositionedImage(*grid, str(header.get("content", "")))


def _named_fields(header: bytes) -> list[bytes]:
    """Lines of a header: fields under the names that pynrrd knows, without pairs of keys and values."""
    lines = []
    for line in header.splitlines(keepends=True):
        name, colon, value = line.partition(b":")
        if colon and not name.startswith(b"#"):
            if value.startswith(b"="):
                continue
            word = re.sub(r"\s+", " ", name.decode("ascii", "ignore").strip().lower())
            line = FIELDS.get(word.replace(" ", ""), word).encode() + b":" + value
        lines.append(line)
    return lines


def _affine(header: Any, shape: Sequence[int]) -> Floats:
    """(4, 4) from nodes to positions, m, RAS, of an image with two or three axes."""
    # Spacings are in units of the axes, directions and origin in those of the space.
    own, space = header.get("units"), header.get("space units")
    around = _metres(space or own)
    rows, corner = np.eye(3), np.zeros(3)
    directions, origin = header.get("space directions"), header.get("space origin")
    if directions is None:
        steps, first = zip(*(_axis(header, k, n) for k, n in enumerate(shape)), strict=True)
        of_axes = _metres(own or space)[: len(shape)]
        rows[range(len(shape)), range(len(shape))] = np.multiply(steps, of_axes)
        corner[: len(shape)] = np.multiply(first, of_axes)
        if origin is not None and corner.any():
            raise InvalidInput("space origin", "one beside axis mins or maxs", "one of them")
    else:
        _check_directions(header, directions)
        if len(shape) == 2 and "space" not in header:
            # ITK writes LPS so, others RAS.
            accepted = "a space, as right-anterior-superior, and vectors of three numbers; or NIfTI"
            raise InvalidInput("space", "none beside the space directions of a plane", accepted)
        rows[: len(shape), : directions.shape[1]] = directions * around[: directions.shape[1]]
    if origin is not None:
        corner[: len(origin)] = np.multiply(origin, around[: len(origin)])
    if len(shape) == 2:
        # A plane is as thick as its first step.
        rows[2] = np.cross(rows[0], rows[1]) / np.linalg.norm(rows[1])
    affine = np.eye(4)
    affine[:3, :3], affine[:3, 3] = rows.T, corner
    return np.diag([*_axis_signs(header.get("space")), 1.0]) @ affine


def _check_directions(header: Any, directions: Floats) -> None:
    """Reject directions that are absent along an axis, or that another field contradicts."""
    numbers = directions.shape[1]
    if numbers not in (len(directions), 3):
        raise InvalidInput("space directions", f"vectors of {numbers} numbers", "vectors of three")
    absent = [k for k in range(len(directions)) if np.isnan(directions[k]).all()]
    if absent:
        raise InvalidInput("space directions", f"none along axis {absent[0]}", "a vector for each axis")
    lengths = np.linalg.norm(directions, axis=1)
    for field in ("spacings", "axis mins", "axis maxs"):
        stated = np.asarray(header.get(field, [math.nan]), np.float64)
        agrees = field == "spacings" and np.allclose(stated, lengths, rtol=AGREE, atol=0.0)
        if np.isfinite(stated).any() and not agrees:
            raise InvalidInput(field, f"{stated.tolist()} beside space directions", "one of them")


def _axis(header: Any, axis: int, nodes: int) -> tuple[float, float]:
    """Step, negative for falling positions, and position of node 0 along an axis without direction.

    Both are in the unit of the axis. ``axis mins`` and ``axis maxs`` are positions of the first and last node
    (centering "node"), or of the outer sides of their cells ("cell").
    """

    stated = {field: header[field][axis] for field in PER_AXIS if field in header}
    step, low, high = (float(stated.get(name, math.nan)) for name in ("spacings", "axis mins", "axis maxs"))
    in_limits = math.isnan(step) and math.isfinite(high - low)
    if "spacings" in header and not (0.0 < step < math.inf or in_limits):
        raise InvalidInput("spacings", [float(v) for v in header["spacings"]], "finite distances above 0")
    if math.isnan(low) and math.isnan(high):
        if math.isnan(step) and "thicknesses" in header:
            raise InvalidInput("spacings", "none beside thicknesses", "distances between nodes")
        return (1.0 if math.isnan(step) else step), 0.0
    centering = str(stated.get("centerings")).lower()
    if centering not in ("cell", "node"):
        accepted = "cell or node, which axis mins and maxs depend on"
        raise InvalidInput("centerings", f"none along axis {axis}", accepted)
    if math.isfinite(high - low):
        between = (high - low) / max(nodes - (centering == "node"), 1)
        if not math.isnan(step) and abs(abs(between) - step) > AGREE * step:
            given = f"{step:g} along axis {axis}, where axis mins and maxs mean {between:g}"
            raise InvalidInput("spacings", given, "one of them, or both alike")
        step = between
    if not math.isfinite(step) or step == 0.0:
        given = f"{low:g} to {high:g} along axis {axis}"
        raise InvalidInput("axis mins", given, "mins and maxs, finite and different")
    inset = 0.5 * step if centering == "cell" else 0.0
    return step, (low + inset if math.isfinite(low) else high - inset - (nodes - 1) * step)


def _axis_signs(space: Any) -> tuple[float, float, float]:
    """Signs of the axes of a space relative to right, front and head."""
    if space is None:
        return 1.0, 1.0, 1.0
    words = str(space).lower().removesuffix("-time")
    signs = SPACES.get(SHORT.get(words, words))
    if signs is None:
        raise InvalidInput("space", repr(space), "one of " + ", ".join((*SPACES, *SHORT)))
    return signs


def _metres(names: Sequence[str] | None) -> NDArray[np.float64]:
    """Units of the three axes, m; mm by default, also of the third axis of a plane."""
    units = [str(name).strip('" ') or "mm" for name in names or ["mm"] * 3]
    if len(units) == 2:
        units.append(units[0])
    for unit in units:
        if unit not in UNITS_M:
            raise InvalidInput("units", repr(unit), "one of " + ", ".join(UNITS_M))
    if len(units) != 3:
        raise InvalidInput("units", ", ".join(units), "three, one for each axis")
    return np.array([UNITS_M[unit] for unit in units])
