"""Reading untrusted HDF5 files: every object is checked before its data are read."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from bentray_kernels.errors import InvalidInput

from .damage import check_real, first_bytes, rejecting_damage

SIGNATURE = b"\x89HDF\r\n\x1a\n"

# Exceptions of HDF5 and h5py on damaged files.
DAMAGE = (OSError, RuntimeError, KeyError, ValueError, TypeError, OverflowError, MemoryError)

FILTERS = {
    h5py.h5z.FILTER_DEFLATE: "gzip",
    h5py.h5z.FILTER_SHUFFLE: "shuffle",
    h5py.h5z.FILTER_FLETCHER32: "fletcher32",
    h5py.h5z.FILTER_LZF: "lzf",
}
TYPES = {h5py.h5t.INTEGER: "integers", h5py.h5t.FLOAT: "floating-point numbers", h5py.h5t.ENUM: "booleans"}
OTHER_TYPES = {
    h5py.h5t.STRING: "text",
    h5py.h5t.COMPOUND: "records",
    h5py.h5t.REFERENCE: "references",
    h5py.h5t.VLEN: "lists of varying length",
    h5py.h5t.OPAQUE: "opaque bytes",
    h5py.h5t.ARRAY: "arrays as elements",
    h5py.h5t.BITFIELD: "bit fields",
    h5py.h5t.TIME: "times",
}

# Incompressible data may grow by this factor, and by a few bytes per chunk.
GROWN = 1.01


@dataclass(frozen=True)
class Limits:
    """Limits of reading a file.

    Attributes:
        total_bytes: of all arrays read from one file, uncompressed.
        chunk_bytes: of one chunk, uncompressed: HDF5 holds it in memory as a whole.
        packing: compression ratio; gzip reaches at most 1032.
        small_bytes: arrays below this may have any compression ratio.
        text: characters of an attribute.
    """

    total_bytes: int = 32 * 2**30
    chunk_bytes: int = 512 * 2**20
    packing: float = 1100.0
    small_bytes: int = 16 * 2**20
    text: int = 100_000


# Of files without limits of their own.
LIMITS = Limits()


@contextmanager
def opened(path: Path, limits: Limits = LIMITS) -> Iterator[Reader]:
    """A reader of the file.

    Raises:
        InvalidInput: for a file that is absent, empty, not HDF5, truncated or damaged.
    """
    accepted = "a whole HDF5 file"
    try:
        with path.open("rb") as raw:
            start = raw.read(len(SIGNATURE))
            # Of the open file: by its name it may be deleted at any time.
            size = os.fstat(raw.fileno()).st_size
    except OSError as error:
        raise InvalidInput("file", f"{path.name}: {error.strerror}", accepted) from None
    try:
        file = h5py.File(path, "r", locking=False)
    except DAMAGE:
        if not start:
            content = "an empty file"
        elif start == SIGNATURE:
            content = f"an HDF5 file that is cut short or damaged ({size} bytes)"
        else:
            content = f"a file that is not HDF5 ({first_bytes(start)})"
        raise InvalidInput("file", content, accepted) from None
    try:
        yield Reader(file, limits)
    finally:
        file.close()


class Reader:
    """Fields of one open file by path, such as ``waveform/object``; attributes as ``waveform@scale``."""

    def __init__(self, file: h5py.File, limits: Limits) -> None:
        self._file = file
        self._limits = limits
        self._read_bytes = 0

    def has(self, path: str) -> bool:
        """Whether a group or array of that path exists."""
        return self._object(path) is not None

    def contains(self, path: str) -> bool:
        """Like ``has``, and false where an array has the name of a group on the path."""
        parent = path.rpartition("/")[0]
        if parent and not (self.contains(parent) and isinstance(self._object(parent), h5py.Group)):
            return False
        return self.has(path)

    def check_format(self, name: str, version: str) -> None:
        """Check the attributes ``format`` and ``format_version`` of the file.

        Raises:
            InvalidInput: naming the first that differs.
        """
        for attribute, accepted in (("format", name), ("format_version", version)):
            if (stored := self.text("", attribute)) != accepted:
                raise InvalidInput(f"@{attribute}", repr(stored), f'"{accepted}"')

    def names(self) -> tuple[str, ...]:
        """Names in the root group."""
        with rejecting_hdf5_damage("file", "a whole HDF5 file"):
            return tuple(self._file)

    def array(self, path: str, kinds: str, accepted: str, most: float = math.inf) -> NDArray[Any] | None:
        """An array, or None if it is absent.

        Args:
            path: of the array.
            kinds: accepted NumPy kinds: of ``i``, ``u``, ``f``, ``b``.
            accepted: these in words, with the shape.
            most: values.

        Raises:
            InvalidInput: for anything else of that path.
        """
        stored = self.checked(path, kinds, accepted)
        if stored is None:
            return None
        if stored.size > most:
            raise InvalidInput(path, f"shape {stored.shape}", accepted)
        self._read_bytes += stored.size * stored.dtype.itemsize
        with rejecting_hdf5_damage(path, accepted):
            return np.asarray(stored[()])

    def required(self, path: str, kinds: str, accepted: str) -> NDArray[Any]:
        """Like ``array``, and raises for an absent array."""
        array = self.array(path, kinds, accepted)
        if array is None:
            raise InvalidInput(path, "nothing", accepted)
        return array

    def checked(self, path: str, kinds: str, accepted: str) -> h5py.Dataset | None:
        """Like ``array``: checked, but not read."""
        item = self._object(path)
        if item is None:
            return None
        if not isinstance(item, h5py.Dataset):
            raise InvalidInput(path, "a group", accepted)
        with rejecting_hdf5_damage(path, accepted):
            _check_storage(path, item, accepted, self._limits, self._read_bytes)
            if item.dtype.kind not in kinds:
                raise InvalidInput(path, f"{TYPES[item.id.get_type().get_class()]} ({item.dtype})", accepted)
        return item

    def attribute(self, path: str, name: str) -> Any:
        """Value of an attribute: str, or an array of numbers; None if it or its owner is absent.

        Raises:
            InvalidInput: for any other type, or more than the limits allow.
        """
        field = f"{path}@{name}"
        owner = self._object(path)
        if owner is None:
            return None
        with rejecting_hdf5_damage(field, "text or numbers"):
            if not h5py.h5a.exists(owner.id, name.encode()):
                return None
            attribute = h5py.h5a.open(owner.id, name.encode())
            kind = attribute.get_type().get_class()
            if kind != h5py.h5t.STRING and kind not in TYPES:
                check_real(field, attribute.dtype, "text or numbers")
                raise InvalidInput(field, OTHER_TYPES.get(kind, "an unknown type"), "text or numbers")
            if attribute.get_space().get_simple_extent_npoints() not in range(1, 17):
                raise InvalidInput(field, f"shape {attribute.shape}", "one value, or one per axis")
            if attribute.get_storage_size() > self._limits.text:
                raise InvalidInput(
                    field, f"{attribute.get_storage_size()} bytes", f"at most {self._limits.text}"
                )
            value = owner.attrs[name]
            if kind != h5py.h5t.STRING:
                return np.atleast_1d(np.asarray(value)).ravel()
            text = np.atleast_1d(np.asarray(value, dtype=object)).ravel()[0]
            text = text.decode("utf-8", "replace") if isinstance(text, bytes) else str(text)
        if len(text) > self._limits.text:
            raise InvalidInput(field, f"{len(text)} characters", f"at most {self._limits.text}")
        return printable(text)

    def text(self, path: str, name: str) -> str | None:
        """A text attribute, or None."""
        value = self.attribute(path, name)
        if value is not None and not isinstance(value, str):
            raise InvalidInput(f"{path}@{name}", f"the number {value[0]}", "text")
        return value

    def numbers(self, path: str, name: str, unit: str) -> tuple[float, ...] | None:
        """A number or one per axis, or None."""
        value = self.attribute(path, name)
        if value is None:
            return None
        if isinstance(value, str):
            raise InvalidInput(f"{path}@{name}", f"the text {value[:40]!r}", f"a number in {unit}")
        return tuple(float(v) for v in value)

    def number(self, path: str, name: str, unit: str) -> float | None:
        """A finite number, or None."""
        values = self.numbers(path, name, unit)
        if values is None:
            return None
        if len(values) != 1 or not math.isfinite(values[0]):
            given = values[0] if len(values) == 1 else f"{len(values)} numbers"
            raise InvalidInput(f"{path}@{name}", given, f"one finite number in {unit}")
        return values[0]

    def _object(self, path: str) -> Any:
        """The group or array at a path, reached by hard links only."""
        here: Any = self._file
        walked = ""
        for name in filter(None, path.split("/")):
            walked = f"{walked}/{name}".lstrip("/")
            with rejecting_hdf5_damage(walked, "a group or an array of this file"):
                if not isinstance(here, h5py.Group):
                    raise InvalidInput(walked.rpartition("/")[0], "an array", "a group")
                if not here.id.links.exists(name.encode()):
                    return None
                if here.id.links.get_info(name.encode()).type != h5py.h5l.TYPE_HARD:
                    raise InvalidInput(walked, "a soft or external link", "a group or an array of this file")
                here = here[name]
                if isinstance(here, h5py.Datatype):
                    raise InvalidInput(walked, "a named type", "a group or an array")
        return here


def _check_storage(path: str, stored: h5py.Dataset, accepted: str, limits: Limits, read_bytes: int) -> None:
    """Reject an array that is not plain numbers stored in this file within the limits.

    Args:
        path: of the array.
        stored: the array, opened but not read.
        accepted: the accepted array, in words.
        limits: of reading.
        read_bytes: of the arrays already read from the file.

    Raises:
        InvalidInput: naming ``path``.
    """
    kind = stored.id.get_type().get_class()
    if kind not in TYPES:
        check_real(path, stored.dtype, accepted)
        raise InvalidInput(path, OTHER_TYPES.get(kind, "an unknown type"), accepted)
    if kind == h5py.h5t.ENUM and stored.dtype.kind != "b":
        raise InvalidInput(path, "names of numbers", accepted)
    if stored.shape is None:
        raise InvalidInput(path, "an array without a shape", accepted)
    how = stored.id.get_create_plist()
    if how.get_layout() not in (h5py.h5d.COMPACT, h5py.h5d.CONTIGUOUS, h5py.h5d.CHUNKED):
        raise InvalidInput(path, "a virtual dataset", "data in this file")
    if how.get_layout() != h5py.h5d.CHUNKED and how.get_external_count():
        raise InvalidInput(path, "data in another file", "data in this file")
    for k in range(how.get_nfilters()):
        code = how.get_filter(k)[0]
        if code not in FILTERS:
            raise InvalidInput(path, f"filter {code}", "the filters " + ", ".join(FILTERS.values()))
    _check_sizes(path, stored, limits, read_bytes)


def _check_sizes(path: str, array: h5py.Dataset, limits: Limits, read_bytes: int) -> None:
    size = math.prod(array.shape) * array.dtype.itemsize
    if size + read_bytes > limits.total_bytes:
        raise InvalidInput(path, f"{size} bytes unpacked", f"at most {limits.total_bytes} bytes in a file")
    stored = array.id.get_storage_size()
    if array.chunks is not None:
        chunk = math.prod(array.chunks) * array.dtype.itemsize
        if chunk > limits.chunk_bytes:
            raise InvalidInput(path, f"chunks of {chunk} bytes", f"at most {limits.chunk_bytes} bytes")
        # Compression makes data hardly larger: chunks that store more would expand beyond their size.
        chunks = math.prod(-(-n // c) for n, c in zip(array.shape, array.chunks, strict=True))
        if stored > chunks * (GROWN * chunk + 64):
            raise InvalidInput(path, f"{stored} bytes in {chunks} chunks of {chunk}", "no more than these")
    if size > limits.small_bytes and size > limits.packing * stored:
        raise InvalidInput(path, f"{size} bytes, of which {stored} are stored", "data that are in the file")


def rejecting_hdf5_damage(field: str, accepted: str) -> AbstractContextManager[None]:
    """Convert exceptions of HDF5 on damaged data to InvalidInput for this field."""
    return rejecting_damage(field, accepted, DAMAGE)


def printable(text: str) -> str:
    """Text without control characters and unpaired surrogates, which HDF5 and JSON cannot store."""
    return "".join(c for c in text if c.isprintable() or c in "\n\t")
