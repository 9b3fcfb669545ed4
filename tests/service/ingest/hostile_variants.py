"""Further damaged files of every format, one fault each, with the field that each is to be refused for."""

import io
import struct
import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from .hostile_meshes import glb, gltf, ply
from .hostile_volumes import UNPLACED, Given, canonical, nifti, nrrd

Case = tuple[str, bytes, Given, str]

# Volumes.
IDENTITY = "space directions: (1,0,0) (0,1,0) (0,0,1)"
SPACE = "space: left-posterior-superior"


def spaced(directions: str, *more: str) -> bytes:
    return nrrd(SPACE, f"space directions: {directions}", *more)


NRRDS: dict[str, tuple[bytes, str]] = {
    **{
        f"dimension {told}": (nrrd(dimension=told), "dimension")
        for told in ("-3", "0", "2", "4", "1000000000")
    },
    **{f"dimension {told!r}": (nrrd(dimension=told), "file") for told in ("three", "3.5", "", "9" * 5000)},
    **{
        f"sizes {told}": (nrrd(sizes=told), "sizes")
        for told in ("0 4 5", "3 4 1000000000", "3 4 99999999999999999999", "1 12 5")
    },
    "two sizes": (nrrd(sizes="12 5"), "sizes"),
    "four sizes": (nrrd(sizes="3 4 5 1"), "sizes"),
    "sizes of words": (nrrd(sizes="a b c"), "file"),
    **{
        f"spacings {told}": (nrrd(f"spacings: {told}"), "spacings")
        for told in ("-1 -1 -1", "1 1 -1", "0 1 1", "nan 1 1", "inf 1 1", "1 1", "1 1 1 1")
    },
    "spacings of light years": (nrrd("spacings: 1e300 1 1"), "spacing_m"),
    "spacings of nothing": (nrrd("spacings: 1e-300 1 1"), "spacing_m"),
    "spacings of words": (nrrd("spacings: a b c"), "file"),
    "directions of nothing": (spaced("(0,0,0) (0,1,0) (0,0,1)"), "spacing_m"),
    "directions that are one": (spaced("(1,0,0) (1,0,0) (0,0,1)"), "space directions"),
    "directions that are none": (spaced("(nan,0,0) (0,1,0) (0,0,1)"), "spacing_m"),
    "endless directions": (spaced("(inf,0,0) (0,1,0) (0,0,1)"), "spacing_m"),
    "directions of light years": (spaced("(1e300,0,0) (0,1,0) (0,0,1)"), "spacing_m"),
    "an origin that is none": (nrrd(SPACE, IDENTITY, "space origin: (nan,0,0)"), "origin_m"),
    "an endless origin": (nrrd(SPACE, IDENTITY, "space origin: (inf,0,0)"), "origin_m"),
    "a far origin": (nrrd(SPACE, IDENTITY, "space origin: (1e300,0,0)"), "origin_m"),
    **{f"type {told}": (nrrd(type=told), "type") for told in ("block", "string", "double[3]", "complex")},
    **{f"encoding {told}": (nrrd(encoding=told), "encoding") for told in ("ascii", "zlib")},
    "a list of data files": (nrrd("data file: LIST"), "data file"),
    "a line skip": (nrrd("line skip: 7"), "line skip"),
    "units of parsecs": (nrrd("spacings: 1 1 1", 'units: "parsec" "mm" "mm"'), "units"),
    "vectors": (nrrd("kinds: vector domain domain"), "kinds"),
    "gzip of nothing": (nrrd(encoding="gzip", values=b""), "file"),
}
NIFTIS: dict[str, tuple[bytes, str]] = {
    "minus three axes": (nifti({"dim": (-3, 3, 4, 5, 1, 1, 1, 1)}), "file"),
    "nine axes": (nifti({"dim": (9, 3, 4, 5, 1, 1, 1, 1)}), "file"),
    "no axes": (nifti({"dim": (0, 3, 4, 5, 1, 1, 1, 1)}), "dim"),
    "an axis of nothing": (nifti({"dim": (3, 0, 4, 5, 1, 1, 1, 1)}), "dim"),
    "moments": (nifti({"dim": (4, 3, 4, 5, 7, 1, 1, 1)}), "dim"),
    "a negative offset": (nifti({"vox_offset": -1.0}), "file"),
    "an offset in the header": (nifti({"vox_offset": 16.0}), "file"),
    "an endless slope": (nifti({"scl_slope": np.inf, "scl_inter": 0.0}), "scl_slope"),
    "no type": (nifti({"datatype": 0}), "file"),
    "steps of nothing": (nifti({"pixdim": (1, 0, 1, 1, 1, 1, 1, 1), **UNPLACED}), "pixdim"),
    "endless steps": (nifti({"pixdim": (1, np.inf, 1, 1, 1, 1, 1, 1), **UNPLACED}), "spacing_m"),
    "steps that are none": (nifti({"pixdim": (1, np.nan, 1, 1, 1, 1, 1, 1), **UNPLACED}), "spacing_m"),
    "two parts": (nifti({"magic": b"ni1\0"}), "file"),
    "a form that is none": (nifti({"srow_x": (np.nan,) * 4, "sform_code": 1}), "spacing_m"),
}
VOLUMES: dict[str, tuple[bytes, str]] = {
    "HDF5 with a negative spacing": (canonical(spacing_m=[-1e-3] * 3), "spacing_m"),
    "HDF5 with two spacings": (canonical(spacing_m=[1e-3] * 2), "spacing_m"),
    "HDF5 with a spacing of words": (canonical(spacing_m="mm"), "@spacing_m"),
    "HDF5 with a far origin": (canonical(origin_m=[1e300] * 3), "origin_m"),
    "HDF5 with an origin that is none": (canonical(origin_m=[np.nan] * 3), "origin_m"),
    "HDF5 of one axis": (canonical((60,)), "values"),
}

# Meshes.
CORNERS = b"v 0 0 0\nv 1 0 0\nv 0 1 0\n"


def face(size: int, corners: str) -> bytes:
    head = (
        "element vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
        "element face 1\nproperty list uchar int vertex_indices\n"
    )
    return ply(head, b"0 0 0\n1 0 0\n0 1 0\n" + f"{size} {corners}\n".encode())


def nodes(*children: list[int], **first: Any) -> bytes:
    """A scene whose nodes have these children; the last one has the mesh."""
    made: list[dict[str, Any]] = [{"children": process} if process else {} for process in children]
    made[-1]["mesh"] = 0
    made[0] |= first
    return gltf(nodes=made)


def primitive(**changed: Any) -> bytes:
    return gltf(meshes=[{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, **changed}]}])


def accessor(**changed: Any) -> bytes:
    plain = [
        {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"},
        {"bufferView": 1, "componentType": 5125, "count": 3, "type": "SCALAR"},
    ]
    return gltf(accessors=[plain[0] | changed, plain[1]])


def view(**changed: Any) -> bytes:
    plain = {"buffer": 0, "byteOffset": 0, "byteLength": 36}
    return gltf(bufferViews=[plain | changed, {"buffer": 0, "byteOffset": 36, "byteLength": 12}])


DRACO = "KHR_draco_mesh_compression"
MESHES: dict[str, tuple[bytes, str]] = {
    **{
        f"OBJ with {line!r}": (CORNERS + line.encode() + b"\n", "faces")
        for line in (
            "f 1 2",
            "f 1",
            "f",
            "f 1//1 2//2",
            "f 1/1/1 2/2/2",
            "  f 1 2  ",
            "f 1 2 # 3",
            "f 1 2 \\\n",
        )
    },
    "OBJ with one bad face": (CORNERS + b"f 1 2 3\nf 3 1\n", "faces"),
    "OBJ of planes": (b"v 0 0\nv 1 0\nv 0 1\nf 1 2 3\n", "vertices"),
    "OBJ with an empty vertex": (CORNERS + b"v\nf 1 2 3\n", "vertices"),
    "OBJ beyond all numbers": (b"v 1e400 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "vertices"),
    "OBJ with words in a face": (CORNERS + b"f a b c\n", "file"),
    "OBJ with a face before the first vertex": (CORNERS + b"f -9 -8 -7\n", "faces"),
    "PLY with a face of two": (face(2, "0 1"), "faces"),
    "PLY with a face of one": (face(1, "0"), "faces"),
    "glTF nodes in a circle": (nodes([1], [0]), "nodes"),
    "glTF nodes in a long circle": (nodes([1], [2], [3], [1]), "nodes"),
    "glTF node in itself": (nodes([0]), "nodes"),
    "glTF diamond": (nodes([1, 2], [3], [3], []), "nodes"),
    "glTF diamond of thirty": (nodes(*([k + 1, k + 1] for k in range(30)), []), "nodes"),
    "glTF child beyond": (nodes([7]), "file"),
    "glTF child before": (nodes([-1]), "file"),
    "glTF child of words": (gltf(nodes=[{"mesh": 0, "children": ["x"]}]), "file"),
    "glTF children that are one": (gltf(nodes=[{"mesh": 0, "children": 1}]), "file"),
    "glTF nodes of numbers": (gltf(nodes=[7]), "file"),
    "glTF of a camera with a mesh": (nodes([], camera=0), "nodes/0"),
    "glTF of a camera above a mesh": (nodes([1], [], camera=0), "nodes/0"),
    "glTF mesh before the first": (nodes([], mesh=-1), "nodes/0/mesh"),
    "glTF buffer before the first": (view(buffer=-1), "bufferViews/0/buffer"),
    "glTF places before the first": (
        primitive(attributes={"POSITION": -2}),
        "meshes/0/primitives/0/POSITION",
    ),
    "glTF colours beyond": (
        primitive(attributes={"POSITION": 0, "COLOR_0": 9}),
        "meshes/0/primitives/0/COLOR_0",
    ),
    "glTF matrix of fifteen": (nodes([], matrix=[1.0] * 15), "file"),
    "glTF matrix of words": (nodes([], matrix=["a"] * 16), "file"),
    "glTF scale of light years": (nodes([], scale=[1e300, 1, 1]), "vertices"),
    "glTF scale of 400 digits": (nodes([], scale=[10**400, 1, 1]), "file"),
    **{
        f"glTF byteLength {length!r}": (gltf(buffers=[{"byteLength": length}]), "file")
        for length in (10**15, -1, 1.5, "48", None, True)
    },
    "glTF view beyond its buffer": (view(byteLength=4800), "file"),
    "glTF view of a far place": (view(byteOffset=10**18), "file"),
    "glTF view before its buffer": (view(byteOffset=-36), "bufferViews/0/byteOffset"),
    "glTF view of no buffer": (view(buffer=9), "bufferViews/0/buffer"),
    "glTF stride": (view(byteStride=10**9), "file"),
    "glTF count": (accessor(count=10**18), "file"),
    "glTF count of nothing": (accessor(count=0), "faces"),
    "glTF component": (accessor(componentType=1), "file"),
    "glTF type": (accessor(type="VEC9"), "file"),
    "glTF sparse": (accessor(sparse={"count": 10**9}), "accessors/0"),
    "glTF with Draco required": (gltf(extensionsRequired=[DRACO]), "extensionsRequired"),
    "glTF with Draco used": (gltf(extensionsUsed=[DRACO]), "extensionsUsed"),
    "glTF with a Draco primitive": (primitive(extensions={DRACO: {}}), "meshes/0/primitives/0"),
    "glTF with meshopt": (gltf(extensionsRequired=["EXT_meshopt_compression"]), "extensionsRequired"),
    "glTF of points": (primitive(mode=0), "meshes/0/primitives/0/mode"),
    "glTF of lines": (primitive(mode=1), "meshes/0/primitives/0/mode"),
    "glTF of a mode of words": (primitive(mode="x"), "meshes/0/primitives/0/mode"),
    "glTF without places": (primitive(attributes={}), "file"),
    "glTF with other indices": (primitive(indices=9), "meshes/0/primitives/0/indices"),
    "GLB in a circle": (glb(nodes([1], [0])), "nodes"),
    "needles": (b"v 0 0 0\nv 1 0 0\nv 0 1e-12 0\nv 0 0 1e-12\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n", "faces"),
}

# Scans.
ANGLE = 2.0 * np.pi * np.arange(8) / 8.0
PLACES = 0.1 * np.column_stack((np.cos(ANGLE), np.sin(ANGLE)))


def archive(**arrays: Any) -> bytes:
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **{"element_positions": PLACES, "delta_tof": np.zeros((8, 8)), **arrays})
    return buffer.getvalue()


SOUND = archive()
FIRST_NAME = "element_positions"
DIRECTORY = b"PK\x01\x02"


def patched(mark: bytes, offset: int, form: str, value: int, which: int = 0) -> bytes:
    """The sound archive with one number of the directory (or of a member's own header) replaced."""
    content, place = bytearray(SOUND), -1
    for _ in range(which + 1):
        place = SOUND.index(mark, place + 1)
    struct.pack_into("<" + form, content, place + offset, value)
    return bytes(content)


def named(name: str) -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as file:
        file.writestr(zipfile.ZipInfo(name), b"x")
    return buffer.getvalue()


def twice() -> bytes:
    """Two members of one name, of which readers take one or the other."""
    content = io.BytesIO(SOUND)
    with zipfile.ZipFile(content, "a") as file:
        entry = file.infolist()[0]
        file.filelist.append(entry)
        file._didModify = True
    return content.getvalue()


def overlapping() -> bytes:
    """Two members that share their data, as bombs of many members do."""
    first, second = (SOUND.index(DIRECTORY), SOUND.index(DIRECTORY, SOUND.index(DIRECTORY) + 1))
    content = bytearray(SOUND)
    content[second + 42 : second + 46] = content[first + 42 : first + 46]
    return bytes(content)


SCANS: dict[str, tuple[bytes, str]] = {
    "npz with a password": (patched(DIRECTORY, 8, "H", 1), "file"),
    "npz with a password of the second": (patched(DIRECTORY, 8, "H", 1, 1), "file"),
    "npz with a strong password": (patched(DIRECTORY, 8, "H", 1 << 6), "file"),
    "npz with a masked directory": (patched(DIRECTORY, 8, "H", 1 << 13), "file"),
    "npz of another packing": (patched(DIRECTORY, 10, "H", 12), "file"),
    "npz with another sum in its directory": (patched(DIRECTORY, 16, "I", 12345), FIRST_NAME),
    **{
        f"npz of {size} packed bytes": (patched(DIRECTORY, 20, "I", size), field)
        for size, field in (
            (0, FIRST_NAME),
            (1, FIRST_NAME),
            (50, FIRST_NAME),
            (5000, "file"),
            (2**31, "file"),
        )
    },
    **{
        f"npz of {size} bytes": (patched(DIRECTORY, 24, "I", size), field)
        for size, field in ((0, FIRST_NAME), (2**31, "file"), (2**32 - 2, "file"))
    },
    "npz of some bytes more": (patched(DIRECTORY, 24, "I", 260), "element_positions"),
    "npz of some bytes fewer": (patched(DIRECTORY, 24, "I", 200), "element_positions"),
    "npz elsewhere": (patched(DIRECTORY, 42, "I", 2**31), "file"),
    "npz in the middle of another": (patched(DIRECTORY, 42, "I", 10), FIRST_NAME),
    "npz with members over each other": (overlapping(), "file"),
    "npz with two of one name": (twice(), "file"),
    **{
        f"npz with the name {number}": (named(name), "file")
        for number, name in enumerate(
            ("../../etc/passwd.npy", "/etc/passwd.npy", "..\\x.npy", "a\n\x1b[31m.npy", "x" * 5000, "./x.npy")
        )
    },
    "npz with positions in mm": (archive(element_positions=1e3 * PLACES), "geometry/element_position_m"),
    "npz with times in µs": (archive(delta_tof=np.full((8, 8), 10.0)), "traveltime/delta_tof_s"),
    "npz with many elements": (archive(element_positions=np.zeros((70_000, 2))), "element_positions"),
    "npz of two elements": (
        archive(element_positions=PLACES[:2], delta_tof=np.zeros((2, 2))),
        "geometry/element_position_m",
    ),
    "npz with complex times": (archive(delta_tof=np.zeros((8, 8), complex)), "delta_tof"),
    "npz with the times of others": (archive(delta_tof=np.zeros((9, 9))), "delta_tof"),
}

REFUSED: dict[str, Case] = {
    f"{what}: {name}": (what, content, {"title": ""} if what == "mesh" else {}, field)
    for what, table in (
        ("volume", NRRDS),
        ("volume", NIFTIS),
        ("volume", VOLUMES),
        ("mesh", MESHES),
        ("dataset", SCANS),
    )
    for name, (content, field) in table.items()
}


def files(folder: Path) -> dict[str, tuple[str, Path, Given]]:
    """Write every file of this module."""
    written = {}
    for number, (name, (what, content, given, _)) in enumerate(REFUSED.items()):
        path = folder / f"variant-{number}"
        path.write_bytes(content)
        written[name] = what, path, given
    return written
