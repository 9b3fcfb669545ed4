"""Checks of glTF files for what trimesh reads without an error, but as another mesh."""

from __future__ import annotations

import json
import math
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
