"""Ways to spoil an open scan: each makes a function that is given the file."""

import zlib
from collections.abc import Callable

import h5py
import numpy as np

PLACE = "traveltime/delta_tof_s"
POSITION = "geometry/element_position_m"
SHAPE = (12, 24)

Build = Callable[[h5py.File], None]


def replaced(path: str, **how: object) -> Build:
    """An array in the place of a sound one; ``how`` as ``h5py.Group.create_dataset`` takes it."""

    def build(file: h5py.File) -> None:
        del file[path]
        file.create_dataset(path, **how)

    return build


def linked(path: str, target: object) -> Build:
    """A link, a type or an object in the place of a sound one."""

    def build(file: h5py.File) -> None:
        del file[path]
        file[path] = target

    return build


def told(owner: str, name: str, value: object) -> Build:
    """An attribute."""

    def build(file: h5py.File) -> None:
        file[owner].attrs[name] = value

    return build


def stored(path: str, place_in: tuple[int, ...], value: object) -> Build:
    """One value of an array."""

    def build(file: h5py.File) -> None:
        file[path][place_in] = value

    return build


def without(path: str) -> Build:
    def build(file: h5py.File) -> None:
        del file[path]

    return build


def low_level(kind: h5py.h5t.TypeID, shape: tuple[int, ...] = SHAPE) -> Build:
    """An array of a type that NumPy does not have."""

    def build(file: h5py.File) -> None:
        del file[PLACE]
        h5py.h5d.create(file["traveltime"].id, b"delta_tof_s", kind, h5py.h5s.create_simple(shape))

    return build


def odd_integer(size: int) -> h5py.h5t.TypeID:
    kind = h5py.h5t.STD_I64LE.copy()
    kind.set_size(size)
    return kind


def external_storage(file: h5py.File) -> None:
    del file[PLACE]
    file.create_dataset(PLACE, SHAPE, np.float64, external=[("/etc/passwd", 0, 12 * 24 * 8)])


def virtual(file: h5py.File) -> None:
    layout = h5py.VirtualLayout(SHAPE, np.float64)
    layout[:] = h5py.VirtualSource("/etc/passwd", "secret", SHAPE)
    del file[PLACE]
    file.create_virtual_dataset(PLACE, layout)


def virtual_of_itself(file: h5py.File) -> None:
    layout = h5py.VirtualLayout(SHAPE, np.float64)
    layout[:] = h5py.VirtualSource(".", PLACE, SHAPE)
    del file[PLACE]
    file.create_virtual_dataset(PLACE, layout)


def custom_filter(code: int) -> Build:
    """Chunks that pass a filter which must not be loaded, let alone be looked for."""

    def build(file: h5py.File) -> None:
        how = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
        how.set_chunk(SHAPE)
        how.set_filter(code, h5py.h5z.FLAG_OPTIONAL, (1, 2))
        del file[PLACE]
        space = h5py.h5s.create_simple(SHAPE)
        group = file["traveltime"].id
        made = h5py.h5d.create(group, b"delta_tof_s", h5py.h5t.IEEE_F64LE, space, how)
        made.write_direct_chunk((0, 0), b"x" * 100)

    return build


def packed(shape: tuple[int, int], rows: int, unpacked: int, times: int = 1) -> Build:
    """Chunks of ``rows`` rows, each of which unpacks to so many zeros, packed ``times`` times."""

    def build(file: h5py.File) -> None:
        del file[PLACE]
        how = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
        how.set_chunk((rows, shape[1]))
        for _ in range(times):
            how.set_deflate(9)
        space = h5py.h5s.create_simple(shape)
        group = file["traveltime"].id
        made = h5py.h5d.create(group, b"delta_tof_s", h5py.h5t.IEEE_F64LE, space, how)
        chunk = zeros(unpacked)
        for _ in range(times - 1):
            chunk = zlib.compress(chunk, 9)
        for row in range(0, shape[0], rows):
            made.write_direct_chunk((row, 0), chunk)

    return build


def zeros(count: int) -> bytes:
    """So many zeros, packed piece by piece."""
    packer, piece = zlib.compressobj(1), bytes(2**20)
    parts = [packer.compress(piece[: min(len(piece), count - k)]) for k in range(0, count, len(piece))]
    return b"".join([*parts, packer.flush()])


def a_loop_of_groups(file: h5py.File) -> None:
    file["geometry/again"] = file["/"]
    del file["traveltime"]
    file["traveltime"] = file["geometry"]


def many_groups(file: h5py.File) -> None:
    group = file.create_group("many")
    for k in range(5_000):
        group.create_group(str(k))


def a_deep_nest(file: h5py.File) -> None:
    here = file.create_group("deep")
    for _ in range(2_000):
        here = here.create_group("d")


def odd_names(file: h5py.File) -> None:
    for name in (b"\xff\xfe\xc3", b"x" * 60_000, b"\x1b[31m", b" ", "‮gnp".encode()):
        h5py.h5g.create(file.id, name)


def a_megabyte_of_notes(file: h5py.File) -> None:
    file.create_group("notes").attrs.create("text", "x" * 60_000)
    for k in range(40):
        file["notes"].attrs[f"t{k}"] = "x" * 60_000
