"""Checks of glTF, OBJ and OFF files for what trimesh reads without an error, but as another mesh."""

import json
import math
import re
import struct
from collections.abc import Iterable, Mapping, Sequence
from itertools import chain
from typing import Any

from bentray_kernels.errors import InvalidInput

# Length of the JSON chunk of a GLB, its place in the file, and where the JSON begins.
GLB_LENGTH, GLB_LENGTH_AT, GLB_JSON_AT = struct.Struct("<I"), 12, 20

# Primitives: separate triangles, and a strip of them; points, lines and fans are not read.
TRIANGLES, STRIP = 4, 5
# Extensions that compress the mesh.
PACKED = ("KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_meshopt_compression")
# Indices of a list into another one.
INDICES = {
    "bufferViews": {"buffer": "buffers"},
    "accessors": {"bufferView": "bufferViews"},
    "nodes": {"mesh": "meshes"},
}
# Counts of bytes and values, of which negative ones count from an end.
COUNTS = ("byteOffset", "byteLength", "count")

Json = Mapping[str, Any]


def check_gltf(data: bytes, kind: str) -> None:
    """Reject a glTF that trimesh would read in part or as another mesh, or that refers to other files.

    Args:
        data: the whole file.
        kind: "gltf" or "glb".

    Raises:
        InvalidInput: naming the list and the index, as ``nodes/3``.
        ValueError, KeyError, TypeError, AttributeError, struct.error: for a file that is no glTF.
    """
    if kind == "glb":
        length = GLB_LENGTH.unpack_from(data, GLB_LENGTH_AT)[0]
        data = data[GLB_JSON_AT : GLB_JSON_AT + length]
        if len(data) < length:
            raise ValueError("a first chunk that is longer than the file")
    scene = json.loads(data)
    lists = {name: scene.get(name, []) for name in ("buffers", "meshes", "scenes", *INDICES)}
    if any(not buffer.get("uri", "data:").startswith("data:") for buffer in lists["buffers"]):
        # The name may be that of any file of this machine; it is not repeated.
        raise InvalidInput("buffers/uri", "data in another file", "data within the file")
    for name in ("extensionsRequired", "extensionsUsed"):
        _check_packing(name, scene.get(name, ()))
    for name, indices in INDICES.items():
        for number, row in enumerate(lists[name]):
            for key in (*indices, *COUNTS):
                most = len(lists[indices[key]]) - 1 if key in indices else math.inf
                _check_number(f"{name}/{number}/{key}", row.get(key), most)
            if name == "accessors" and ("sparse" in row or "bufferView" not in row):
                given = "a sparse accessor, or one without data"
                raise InvalidInput(f"accessors/{number}", given, "an accessor with its own data")
    for number, mesh in enumerate(lists["meshes"]):
        for which, primitive in enumerate(mesh["primitives"]):
            _check_primitive(f"meshes/{number}/primitives/{which}", primitive, len(lists["accessors"]) - 1)
    _check_tree(lists["nodes"], lists["scenes"])


def _check_packing(path: str, extensions: Iterable[str]) -> None:
    if any(extension in PACKED for extension in extensions):
        raise InvalidInput(
            path, "a compressed mesh", "a mesh that is not compressed; export it without Draco"
        )


def _check_number(path: str, value: int | None, most: float) -> None:
    if value is not None and not 0 <= value <= most:
        accepted = "a number of 0 or more" if most == math.inf else f"an index of the file, 0 to {most}"
        raise InvalidInput(path, value, accepted)


def _check_primitive(path: str, primitive: Json, last: int) -> None:
    """Check a primitive, whose accessors are numbered up to ``last``."""
    _check_packing(path, primitive.get("extensions", ()))
    mode = primitive.get("mode", TRIANGLES)
    if mode not in (TRIANGLES, STRIP):
        raise InvalidInput(f"{path}/mode", repr(mode)[:40], "4 or 5: triangles, or a strip of them")
    for name, index in ({"indices": primitive.get("indices")} | primitive["attributes"]).items():
        _check_number(f"{path}/{name}", index, last)


def _check_tree(nodes: Sequence[Json], scenes: Sequence[Json]) -> None:
    """Check that each node is reached once: the roots of a scene and all children differ."""
    children = list(chain.from_iterable(node.get("children", ()) for node in nodes))
    for roots in ([], *(scene.get("nodes", []) for scene in scenes)):
        if len({*children, *roots}) < len(children) + len(roots):
            raise InvalidInput("nodes", "a node with two parents, or below itself", "a tree of nodes")
    for number, node in enumerate(nodes):
        if "camera" in node and ("mesh" in node or node.get("children")):
            given = "a camera with a mesh or with nodes below it"
            raise InvalidInput(
                f"nodes/{number}", given, "a mesh in nodes of its own; export it without cameras"
            )


# Length of a line in an error message.
SHOWN = 60

# Continued lines; faces of fewer than three corners; vertices of fewer than three numbers.
OBJ_CONTINUED = re.compile(rb"\\[ \t]*\r?\n")
OBJ_SHORT = re.compile(rb"^[ \t]*([vf])(?:[ \t]+[^\s#]+){0,2}[ \t]*(?:#.*)?\r?$", re.MULTILINE)
OBJ_ACCEPTED = {b"v": ("vertices", "three numbers, x y z"), b"f": ("faces", "three corners or more")}
# Vertices, and faces with their corners; a corner is a vertex, and after a slash texture and normal.
OBJ_RECORD = re.compile(rb"^[ \t]*(?:(v)[ \t]|f[ \t]+([^\r\n#]*))", re.MULTILINE)
# A corner that counts vertices back from its face, or from 0.
OBJ_RELATIVE = re.compile(rb"^[ \t]*f[^\r\n#]*[ \t](?:-|0+(?![0-9]))", re.MULTILINE)


def plain_obj(data: bytes) -> bytes:
    """An OBJ whose faces count vertices from 1, without what readers take for other vertices.

    Args:
        data: the whole file.

    Returns:
        The same text, where faces count vertices back from their line (-1: the last one so far) with the
        vertices alone: readers count back from the end of the file.

    Raises:
        InvalidInput: ``faces`` or ``vertices``, with the line: an incomplete face, which readers skip, an
            incomplete vertex, or a face of a vertex that is not there.
    """
    text = OBJ_CONTINUED.sub(b" ", data)
    if (match := OBJ_SHORT.search(text)) is not None:
        field, accepted = OBJ_ACCEPTED[match[1]]
        raise InvalidInput(field, _shown(text, match), accepted)
    return _absolute(text) if OBJ_RELATIVE.search(text) else data


def _absolute(text: bytes) -> bytes:
    """Replace relative indices of vertices."""
    before = 0

    def replaced(record: re.Match[bytes]) -> bytes:
        nonlocal before
        if record[1]:
            before += 1
            return record[0]
        numbers = [int(corner.partition(b"/")[0]) for corner in record[2].split()]
        if 0 in numbers or -min(numbers) > before:
            raise InvalidInput(
                "faces", _shown(text, record), f"vertices from 1, or from -1 to -{before} back from the face"
            )
        return b"f " + b" ".join(b"%d" % (n if n > 0 else before + 1 + n) for n in numbers)

    return OBJ_RECORD.sub(replaced, text)


def _shown(text: bytes, line: re.Match[bytes]) -> str:
    number = text.count(b"\n", 0, line.start()) + 1
    return f"{line[0].strip()[:SHOWN].decode(errors='replace')!r} in line {number}"


OFF_HEADERS = (b"OFF", b"COFF", b"NOFF", b"CNOFF")


def plain_off(data: bytes) -> bytes:
    """An OFF without comments, with which trimesh loses lines; one that it would read in part is rejected.

    Args:
        data: the whole file, which begins with one of ``OFF_HEADERS``.

    Returns:
        The same text without comments.

    Raises:
        InvalidInput: ``file`` for missing lines; ``faces`` for the first one without its corners.
        ValueError, IndexError: for counts that are no numbers.
    """
    plain = re.sub(rb"#[^\n]*", b"", data)
    lines = [words for words in (line.split() for line in plain.splitlines()) if words]
    counts, *rows = [lines[0][1:], *lines[1:]] if lines[0][1:] else lines[1:]
    vertices, faces = int(counts[0]), int(counts[1])
    if min(vertices, faces) < 0 or len(rows) < vertices + faces:
        given = f"{len(rows)} lines of the {vertices} vertices and {faces} faces of its counts"
        raise InvalidInput("file", f"an OFF file that ends too soon: {given}", "a whole OFF file")
    for number, words in enumerate(rows[vertices : vertices + faces]):
        if not 3 <= int(words[0]) < len(words):
            given = f"{b' '.join(words)[:SHOWN].decode(errors='replace')!r} as face {number}"
            raise InvalidInput("faces", given, "the number of corners, 3 or more, and their vertices")
    return plain
