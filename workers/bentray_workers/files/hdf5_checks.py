"""Checks of arrays in untrusted HDF5 files: type, storage, filters and size."""

from __future__ import annotations

import math
from dataclasses import dataclass

import h5py

from bentray_kernels.errors import InvalidInput

from .complex_numbers import check_real

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


def check_storage(path: str, stored: h5py.Dataset, accepted: str, limits: Limits, read_bytes: int) -> None:
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
