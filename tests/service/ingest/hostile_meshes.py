"""Meshes that are built to harm, in every format, with the field that each is to be refused for."""

import base64
import json
import struct
from pathlib import Path
from typing import Any

import trimesh

BOX = trimesh.creation.box()
PLY = BOX.export(file_type="ply")
STL = BOX.export(file_type="stl")
OFF = BOX.export(file_type="off").encode()
GLB = BOX.export(file_type="glb")


def ply(head: str, body: bytes = b"", form: str = "ascii") -> bytes:
    return f"ply\nformat {form} 1.0\n{head}end_header\n".encode() + body


def elements(vertices: int, faces: int, count: str = "uchar") -> str:
    return (
        f"element vertex {vertices}\nproperty float x\nproperty float y\nproperty float z\n"
        f"element face {faces}\nproperty list {count} int vertex_indices\n"
    )


def gltf(**changed: Any) -> bytes:
    """A triangle in glTF with some of its parts replaced."""
    data = struct.pack("<9f3I", 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 1, 2)
    here = "data:application/octet-stream;base64," + base64.b64encode(data).decode()
    scene = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5125, "count": 3, "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": 36},
            {"buffer": 0, "byteOffset": 36, "byteLength": 12},
        ],
        "buffers": [{"byteLength": 48, "uri": here}],
    }
    return json.dumps(scene | changed).encode()


def glb(scene: bytes, length: int | None = None, total: int | None = None) -> bytes:
    """A GLB of one JSON chunk, which says of itself what it likes."""
    size = len(scene) if length is None else length
    whole = 20 + len(scene) if total is None else total
    return struct.pack("<4sIII4s", b"glTF", 2, whole, size, b"JSON") + scene


def views(count: int, offset: int = 0) -> list[dict[str, Any]]:
    return [
        {"bufferView": 0, "componentType": 5126, "count": count, "type": "VEC3", "byteOffset": offset},
        {"bufferView": 1, "componentType": 5125, "count": 3, "type": "SCALAR"},
    ]


TRIANGLE = b"0 0 0\n1 0 0\n0 1 0\n"

# Name: the content, and the field that its refusal names.
REFUSED: dict[str, tuple[bytes, str]] = {
    "nothing known": (b"no mesh at all, and nothing like one", "file"),
    "a pickle": (b"\x80\x04\x8c\x05posix\x94\x8c\x06system\x94\x93\x94.", "file"),
    "a packed mesh": (b"PK\x03\x04" + bytes(100), "file"),
    # PLY.
    "a PLY without an end": (b"ply\nformat ascii 1.0\nelement vertex 3\n", "file"),
    "a PLY of no form": (ply(elements(3, 1), TRIANGLE + b"3 0 1 2\n", "roman"), "file"),
    "billions of vertices": (ply(elements(4 * 10**9, 1), TRIANGLE), "faces"),
    "billions of binary vertices": (ply(elements(4 * 10**9, 1), bytes(100), "binary_little_endian"), "file"),
    "a negative count": (ply(elements(-3, 1), TRIANGLE + b"3 0 1 2\n"), "faces"),
    "a list of billions": (
        ply(elements(3, 1, "uint"), bytes(36) + b"\xff" * 4 + bytes(12), "binary_little_endian"),
        "file",
    ),
    "a face of nothing": (ply(elements(3, 1), TRIANGLE + b"0\n"), "faces"),
    "a corner that is not there": (ply(elements(3, 1), TRIANGLE + b"3 0 1 7\n"), "faces"),
    "a corner before the first": (ply(elements(3, 1), TRIANGLE + b"3 0 1 -9\n"), "faces"),
    "a PLY cut short": (PLY[: len(PLY) // 2], "file"),
    "words for numbers": (ply(elements(3, 1), b"a b c\n" * 3 + b"3 0 1 2\n"), "file"),
    "a place that is none": (ply(elements(3, 1), b"nan 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"), "vertices"),
    "a header without end": (b"ply\nformat ascii 1.0\n" + b"comment x\n" * 100_000, "file"),
    # OBJ.
    "no faces": (b"v 0 0 0\nv 1 0 0\nv 0 1 0\n", "faces"),
    "an index beyond": (b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 99999999999\n", "file"),
    "an index of nothing": (b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 0 0 0\n", "faces"),
    "an endless place": (b"v inf 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "vertices"),
    "a library of looks": (b"mtllib /etc/passwd\nv 0 0 0\nv x y z\nf 1 2 3\n", "file"),
    # OFF.
    "counts of OFF": (b"OFF\n4000000000 4000000000 0\n0 0 0\n", "file"),
    "negative counts of OFF": (b"OFF\n-3 -1 0\n0 0 0\n", "file"),
    "no counts of OFF": (b"OFF\n", "file"),
    "an OFF cut short": (OFF[: len(OFF) // 2], "file"),
    # STL.
    "an STL cut short": (STL[:-30], "file"),
    "billions of triangles": (bytes(80) + struct.pack("<I", 2**32 - 1) + bytes(200), "file"),
    "no triangles": (bytes(84), "faces"),
    "triangles of noise": (bytes(80) + struct.pack("<I", 2) + b"\xff" * 100, "vertices"),
    "an STL of words": (
        b"solid\nfacet normal a b c\nouter loop\nvertex x y z\nendloop\nendfacet\nendsolid\n",
        "file",
    ),
    # glTF.
    "a buffer in a file": (gltf(buffers=[{"byteLength": 48, "uri": "/etc/passwd"}]), "buffers/uri"),
    "a buffer in the net": (gltf(buffers=[{"byteLength": 48, "uri": "http://127.0.0.1/x"}]), "buffers/uri"),
    "a buffer above": (gltf(buffers=[{"byteLength": 48, "uri": "../../x.bin"}]), "buffers/uri"),
    "a buffer of a number": (gltf(buffers=[{"byteLength": 48, "uri": 7}]), "file"),
    "a count of billions": (gltf(accessors=views(4 * 10**9)), "file"),
    "a negative count of glTF": (gltf(accessors=views(-3)), "accessors/0/count"),
    "an offset far away": (gltf(accessors=views(3, 10**12)), "file"),
    "an accessor of nothing": (gltf(accessors=[]), "meshes/0/primitives/0/indices"),
    "a mesh that is not there": (gltf(nodes=[{"mesh": 9}]), "nodes/0/mesh"),
    "a scene of nothing": (gltf(scenes=[], nodes=[], meshes=[]), "file"),
    "a sparse accessor": (
        gltf(accessors=[{"componentType": 5126, "count": 10**10, "type": "VEC3"}]),
        "accessors/0",
    ),
    "a list for a scene": (b"[" * 5000, "file"),
    "a deep scene": (b'{"a":' * 100_000, "file"),
    "a scene of a number": (b'{"meshes": 7}', "file"),
    "a long chunk": (glb(gltf(), length=2**32 - 1), "file"),
    "a short chunk": (glb(gltf(), length=5), "file"),
    "a GLB of the mark alone": (b"glTF", "file"),
    "a GLB cut short": (GLB[: len(GLB) // 2], "file"),
    "a GLB of zeros": (b"glTF" + bytes(1000), "file"),
}

# A node that nobody asks for does no harm.
TAKEN: dict[str, bytes] = {
    "a triangle": gltf(),
    "a node beside the tree": gltf(nodes=[{"mesh": 0}, {}]),
    "very many nodes": gltf(nodes=[{"mesh": 0}] * 100_001),
}


def files(folder: Path) -> dict[str, tuple[Path, dict[str, Any]]]:
    """Write every mesh of this module."""
    written = {}
    contents = {name: content for name, (content, _) in REFUSED.items()} | TAKEN
    for number, (name, content) in enumerate(contents.items()):
        path = folder / f"mesh-{number}"
        path.write_bytes(content)
        written[name] = path, {"title": ""}
    return written
