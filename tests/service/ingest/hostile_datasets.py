"""Hostile scans: each spoils one field of a valid file and names the expected error."""

import zlib
from collections.abc import Collection
from pathlib import Path

import h5py
import numpy as np

from . import spoiling as spoil
from .spoiling import PLACE, POSITION, SHAPE

COMPOUND = np.dtype([("a", "f8"), ("b", "i4")])
BIG = 2**40

# Name: what builds it, and the field that its refusal names.
REFUSED: dict[str, tuple[spoil.Build, str]] = {
    # Links, and data that lie elsewhere.
    "external link": (spoil.linked(PLACE, h5py.ExternalLink("/etc/passwd", "/x")), PLACE),
    "external link to a device": (
        spoil.linked(PLACE, h5py.ExternalLink("/dev/zero", "/x")),
        PLACE,
    ),
    "external group": (spoil.linked("traveltime", h5py.ExternalLink("other.h5", "/")), "traveltime"),
    "soft link": (spoil.linked(PLACE, h5py.SoftLink("/truth/sound_speed_mps")), PLACE),
    "soft link to itself": (spoil.linked(PLACE, h5py.SoftLink("/" + PLACE)), PLACE),
    "soft link to nothing": (spoil.linked(PLACE, h5py.SoftLink("/nowhere")), PLACE),
    "soft link to a group": (spoil.linked("water", h5py.SoftLink("/geometry")), "water"),
    "external storage": (spoil.external_storage, PLACE),
    "virtual": (spoil.virtual, PLACE),
    "virtual of itself": (spoil.virtual_of_itself, PLACE),
    # Types.
    "lists": (spoil.replaced(PLACE, shape=SHAPE, dtype=h5py.vlen_dtype(np.float64)), PLACE),
    "text": (spoil.replaced(PLACE, shape=SHAPE, dtype=h5py.string_dtype()), PLACE),
    "text of one length": (spoil.replaced(PLACE, shape=SHAPE, dtype="S8"), PLACE),
    "references": (spoil.replaced(PLACE, shape=SHAPE, dtype=h5py.ref_dtype), PLACE),
    "region references": (
        spoil.replaced(PLACE, shape=SHAPE, dtype=h5py.regionref_dtype),
        PLACE,
    ),
    "records": (spoil.replaced(PLACE, shape=SHAPE, dtype=COMPOUND), PLACE),
    "complex": (spoil.replaced(PLACE, shape=SHAPE, dtype=np.complex128), PLACE),
    "opaque": (spoil.replaced(PLACE, shape=SHAPE, dtype="V8"), PLACE),
    "arrays": (spoil.replaced(PLACE, shape=SHAPE, dtype=np.dtype(("f8", (3,)))), PLACE),
    "names of numbers": (
        spoil.replaced(PLACE, shape=SHAPE, dtype=h5py.enum_dtype({"a": 1, "b": 2}, basetype="i4")),
        PLACE,
    ),
    "booleans": (spoil.replaced(PLACE, shape=SHAPE, dtype=bool), PLACE),
    "bit fields": (spoil.low_level(h5py.h5t.STD_B64LE), PLACE),
    "times": (spoil.low_level(h5py.h5t.UNIX_D32LE), PLACE),
    "a named type": (spoil.linked(PLACE, np.dtype("f8")), PLACE),
    "of a named type of records": (spoil.low_level(h5py.h5t.py_create(COMPOUND)), PLACE),
    "integers of 24 bits": (spoil.low_level(spoil.odd_integer(3)), PLACE),
    # Sizes.
    "terabytes": (spoil.replaced(PLACE, shape=(BIG, 2**10), dtype="f8", chunks=(64, 64)), PLACE),
    "terabytes in one piece": (spoil.replaced(PLACE, shape=(2**37, 2), dtype="f8"), PLACE),
    "more than fits into 64 bits": (
        spoil.replaced(PLACE, shape=(2**31, 2**30), dtype="f8", chunks=(8, 8)),
        PLACE,
    ),
    "nothing stored": (
        spoil.replaced(PLACE, shape=(2**12, 2**12), dtype="f8", chunks=(64, 64)),
        PLACE,
    ),
    "a giant chunk": (
        spoil.replaced(PLACE, shape=(2**14, 2**13), dtype="f8", chunks=(2**14, 2**13)),
        PLACE,
    ),
    "no rows": (spoil.replaced(PLACE, data=np.zeros((0, 24))), PLACE),
    "one number": (spoil.replaced(PLACE, data=1.0), PLACE),
    "no space": (spoil.replaced(PLACE, data=h5py.Empty("f8")), PLACE),
    "many axes": (spoil.replaced(PLACE, data=np.zeros((1,) * 32)), PLACE),
    "another shape": (spoil.replaced(PLACE, data=np.zeros((24, 12))), PLACE),
    "a slice too many": (spoil.replaced(PLACE, data=np.zeros((3, *SHAPE))), PLACE),
    # Packing.
    "zstandard": (spoil.custom_filter(32015), PLACE),
    "blosc": (spoil.custom_filter(32001), PLACE),
    "an unknown filter": (spoil.custom_filter(255), PLACE),
    "szip": (spoil.custom_filter(h5py.h5z.FILTER_SZIP), PLACE),
    "scale offset": (
        spoil.replaced(PLACE, data=np.zeros(SHAPE, "i4"), chunks=SHAPE, scaleoffset=4),
        PLACE,
    ),
    "16 GiB of zeros": (spoil.packed((1024, 2**21), 1, 2**24), PLACE),
    "packed twice": (spoil.packed((64, 2**20), 1, 2**23, times=2), PLACE),
    "a chunk that unpacks to more": (spoil.packed(SHAPE, 12, 2**27), PLACE),
    # Attributes.
    "a text too long": (spoil.told("/", "title", "x" * 2_000_000), "@title"),
    "many speeds": (spoil.told("water", "sound_speed_mps", np.full(1000, 1500.0)), "water@sound_speed_mps"),
    "a record": (spoil.told("water", "sound_speed_mps", np.zeros(1, COMPOUND)), "water@sound_speed_mps"),
    "a speed as text": (spoil.told("water", "sound_speed_mps", "fast"), "water@sound_speed_mps"),
    "an empty attribute": (spoil.told("water", "sound_speed_mps", h5py.Empty("f8")), "water@sound_speed_mps"),
    "a speed that is none": (spoil.told("water", "sound_speed_mps", np.nan), "water@sound_speed_mps"),
    "an endless speed": (spoil.told("water", "sound_speed_mps", np.inf), "water@sound_speed_mps"),
    "a negative speed": (spoil.told("water", "sound_speed_mps", -1500.0), "water@sound_speed_mps"),
    "a format as a number": (spoil.told("/", "format", 7), "@format"),
    "another format": (spoil.told("/", "format", "uct-reflection"), "@format"),
    "a version of the future": (spoil.told("/", "format_version", "9.0"), "@format_version"),
    "the wrong dimension": (spoil.told("/", "dimension", 3), "@dimension"),
    "an unknown array": (spoil.told("geometry", "array_type", "pyramid"), "geometry@array_type"),
    "no time at all": (spoil.told("acquisition", "t0_s", np.nan), "acquisition@t0_s"),
    "no sampling": (spoil.told("acquisition", "sampling_rate_hz", 0.0), "acquisition@sampling_rate_hz"),
    "axes as numbers": (spoil.told("truth", "axes", [1, 2]), "truth@axes"),
    "three spacings for two axes": (spoil.told("truth", "spacing_m", [1e-3] * 3), "truth@spacing_m"),
    # Structure.
    "an array as a group": (spoil.linked("traveltime", np.zeros(3)), "traveltime"),
    "no geometry": (spoil.without("geometry"), POSITION),
    "no positions": (spoil.without(POSITION), POSITION),
    "no emitters": (spoil.without("acquisition/tx"), "acquisition/tx"),
    "no water": (spoil.without("water"), "water@sound_speed_mps"),
    # Values.
    "a place that is none": (spoil.stored(POSITION, (3, 0), np.nan), POSITION),
    "an endless place": (spoil.stored(POSITION, (3, 1), -np.inf), POSITION),
    "a negative index": (spoil.stored("acquisition/tx", (1,), -1), "acquisition/tx"),
    "an index too far": (spoil.stored("acquisition/rx", (1,), 24), "acquisition/rx"),
    "fractional indices": (spoil.replaced("acquisition/tx", data=np.linspace(0, 1, 12)), "acquisition/tx"),
    "the greatest index": (
        spoil.replaced("acquisition/tx", data=np.full(12, 2**64 - 1, np.uint64)),
        "acquisition/tx",
    ),
    "a square of indices": (spoil.replaced("acquisition/tx", data=np.zeros((3, 4), int)), "acquisition/tx"),
    "two elements": (spoil.replaced(POSITION, data=np.zeros((2, 2))), POSITION),
    "four dimensions": (spoil.replaced(POSITION, data=np.zeros((24, 4))), POSITION),
    "complex traces": (
        spoil.replaced("waveform/object", data=np.zeros((12, 24, 20), "c8")),
        "waveform/object",
    ),
    "no traces": (spoil.replaced("waveform/object", data=np.zeros((12, 24, 0), "i2")), "waveform/object"),
    "traces of others": (
        spoil.replaced("waveform/water", data=np.zeros((12, 24, 9), "i2")),
        "waveform/water",
    ),
    "flags of others": (spoil.replaced("mask/valid", data=np.zeros((5, 5), bool)), "mask/valid"),
    "a truth without speed": (
        spoil.replaced("truth/sound_speed_mps", data=np.zeros((32, 32))),
        "truth/sound_speed_mps",
    ),
}

# What the format does not know is never opened, so it does no harm.
TAKEN: dict[str, spoil.Build] = {
    "a loop of groups": spoil.a_loop_of_groups,
    "5,000 groups": spoil.many_groups,
    "a deep nest": spoil.a_deep_nest,
    "odd names": spoil.odd_names,
    "a megabyte of notes": spoil.a_megabyte_of_notes,
    "an unknown external link": lambda file: file.__setitem__("more", h5py.ExternalLink("/dev/zero", "/x")),
    "no travel time at all": spoil.replaced(PLACE, data=np.full(SHAPE, np.nan)),
    "half precision": spoil.replaced(PLACE, data=np.zeros(SHAPE, np.float16)),
    "big-endian": spoil.replaced(PLACE, data=np.zeros(SHAPE, ">f8")),
}

# No HDF5 at all.
FOREIGN: dict[str, bytes] = {
    "nothing but the mark": b"\x89HDF\r\n\x1a\n",
    "the mark and zeros": b"\x89HDF\r\n\x1a\n" + bytes(4096),
    "the mark and ones": b"\x89HDF\r\n\x1a\n" + b"\xff" * 4096,
    "zeros": bytes(100_000),
    "a request": b"GET / HTTP/1.1\r\n\r\n" * 100,
    "a pickle": b"\x80\x04\x95\x1c\x00\x00\x00\x00\x00\x00\x00\x8c\x05posix\x94\x8c\x06system\x94\x93\x94.",
    "a PNG": b"\x89PNG\r\n\x1a\n" + bytes(100),
    "a packed file": zlib.compress(bytes(10**6)),
    "one byte": b"\x89",
}


BUILT: dict[str, spoil.Build] = {name: build for name, (build, _) in REFUSED.items()} | TAKEN


def files(sound: bytes, folder: Path, names: Collection[str] = (*BUILT, *FOREIGN)) -> dict[str, Path]:
    """Write scans of this module by their names: all of them, or some."""
    written = {}
    for name in names:
        path = folder / f"scan-{len(written)}"
        if name in FOREIGN:
            path.write_bytes(FOREIGN[name])
        else:
            path.write_bytes(sound)
            with h5py.File(path, "a") as file:
                BUILT[name](file)
        written[name] = path
    return written
