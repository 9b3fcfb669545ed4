"""Checks of glTF files: a tree of nodes, and data within the file."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from bentray_kernels.errors import InvalidInput

# Bytes of a number by glTF's code for its type; numbers of an element by its name.
COMPONENT_BYTES = {5120: 1, 5121: 1, 5122: 2, 5123: 2, 5125: 4, 5126: 4}
NUMBERS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}

# Of nodes, meshes, primitives, accessors, views and buffers.
MAX_PARTS = 100_000
# Primitives: separate triangles, and a strip of them; points, lines and fans are not read.
TRIANGLES, STRIP = 4, 5

# Extensions that compress the mesh: without them another mesh would be read.
PACKED = ("KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_meshopt_compression")

Json = Mapping[str, Any]


def check_gltf(scene: Any, data_bytes: int, most_faces: int) -> None:
    """Reject a glTF with cycles, too much data, or data that would be read wrongly.

    Args:
        scene: the JSON of the file.
        data_bytes: of the whole file; no buffer in it can be larger.
        most_faces: of all instances together.

    Raises:
        InvalidInput: naming the list and the index, as ``nodes/3``.
    """
    if not isinstance(scene, dict):
        raise InvalidInput("file", "JSON that is no object", "a glTF scene")
    lists = {
        name: _objects(scene, name)
        for name in ("buffers", "bufferViews", "accessors", "meshes", "nodes", "scenes")
    }
    for name in ("extensionsRequired", "extensionsUsed"):
        for extension in PACKED:
            if extension in scene.get(name, ()):
                raise InvalidInput(name, extension, "a mesh that is not compressed; export it without Draco")
    _check_data(lists, data_bytes)
    faces = [_mesh_faces(number, mesh, lists) for number, mesh in enumerate(lists["meshes"])]
    _check_tree(lists["nodes"], faces, most_faces)


def _objects(scene: Json, name: str) -> Sequence[Json]:
    objects = scene.get(name, [])
    if not isinstance(objects, list) or not all(isinstance(one, dict) for one in objects):
        raise InvalidInput(name, "no list of objects", "a list, as glTF 2.0 has it")
    if len(objects) > MAX_PARTS:
        raise InvalidInput(name, len(objects), f"at most {MAX_PARTS}")
    return objects


def _count(place: str, one: Json, key: str, default: int | None = None, most: float = math.inf) -> int:
    """A whole number from 0 to ``most``."""
    value = one.get(key, default)
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value <= most:
        accepted = "a whole number of 0 or more" if most == math.inf else f"a whole number from 0 to {most:g}"
        raise InvalidInput(f"{place}/{key}", "nothing" if value is None else repr(value)[:40], accepted)
    return value


def _member(place: str, one: Json, key: str, many: Sequence[Any]) -> Any:
    """The member with an index."""
    if not many:
        raise InvalidInput(f"{place}/{key}", repr(one.get(key))[:40], "nothing: there is none in the file")
    return many[_count(place, one, key, most=len(many) - 1)]


def _check_data(lists: Mapping[str, Sequence[Json]], data_bytes: int) -> None:
    for number, buffer in enumerate(lists["buffers"]):
        _count(f"buffers/{number}", buffer, "byteLength", most=data_bytes)
    for number, view in enumerate(lists["bufferViews"]):
        place = f"bufferViews/{number}"
        size = _member(place, view, "buffer", lists["buffers"])["byteLength"]
        begin = _count(place, view, "byteOffset", 0, most=size)
        _count(place, view, "byteLength", most=size - begin)
    for number, accessor in enumerate(lists["accessors"]):
        place = f"accessors/{number}"
        if "sparse" in accessor or "bufferView" not in accessor:
            raise InvalidInput(
                place, "a sparse accessor, or one without data", "an accessor with its own data"
            )
        size = COMPONENT_BYTES.get(accessor.get("componentType", 0))
        numbers = NUMBERS.get(str(accessor.get("type")))
        if size is None or numbers is None:
            raise InvalidInput(place, "values of an unknown type", "a type of glTF 2.0")
        view = _member(place, accessor, "bufferView", lists["bufferViews"])
        begin = _count(place, accessor, "byteOffset", 0, most=view["byteLength"])
        step = (
            _count(f"bufferViews/{accessor['bufferView']}", view, "byteStride", 0, most=252) or size * numbers
        )
        count = _count(place, accessor, "count")
        if count < 1 or begin + (count - 1) * step + size * numbers > view["byteLength"]:
            raise InvalidInput(
                f"{place}/count", count, f"from 1, within the {view['byteLength']} bytes of its view"
            )


def _mesh_faces(number: int, mesh: Json, lists: Mapping[str, Sequence[Json]]) -> int:
    """Check the primitives of a mesh; returns its number of triangles."""
    faces = 0
    for which, primitive in enumerate(_objects(mesh, "primitives")):
        place = f"meshes/{number}/primitives/{which}"
        if any(extension in PACKED for extension in primitive.get("extensions", ())):
            raise InvalidInput(
                place, "a compressed mesh", "a mesh that is not compressed; export it without Draco"
            )
        mode = primitive.get("mode", TRIANGLES)
        if mode not in (TRIANGLES, STRIP):
            raise InvalidInput(f"{place}/mode", repr(mode)[:40], "4 or 5: triangles, or a strip of them")
        attributes = primitive.get("attributes")
        if not isinstance(attributes, dict):
            raise InvalidInput(f"{place}/attributes", "nothing", "POSITION at least")
        corners = _member(place, attributes, "POSITION", lists["accessors"])["count"]
        if "indices" in primitive:
            corners = _member(place, primitive, "indices", lists["accessors"])["count"]
        if corners < 3 or (mode == TRIANGLES and corners % 3):
            raise InvalidInput(place, f"{corners} corners", "three for each triangle")
        faces += corners // 3 if mode == TRIANGLES else corners - 2
    return faces


def _check_tree(nodes: Sequence[Json], faces: Sequence[int], most_faces: int) -> None:
    """Check that each node has at most one parent and that there are no cycles."""
    parent: dict[int, int] = {}
    total = 0
    for number, node in enumerate(nodes):
        place = f"nodes/{number}"
        if "mesh" in node:
            total += _member(place, node, "mesh", faces)
        children = node.get("children", [])
        if not isinstance(children, list):
            raise InvalidInput(f"{place}/children", "no list", "a list of nodes")
        for child in children:
            _count(place, {"children": child}, "children", most=len(nodes) - 1)
            if child in parent:
                raise InvalidInput(
                    f"{place}/children", f"node {child}, which node {parent[child]} has too", "a tree"
                )
            parent[child] = number
        _check_transform(place, node)
    if total > most_faces:
        raise InvalidInput("nodes", f"{total} faces in all instances of meshes", f"at most {most_faces}")
    # With one parent each, nodes that are not reached from a root are in a cycle.
    waiting = [number for number in range(len(nodes)) if number not in parent]
    reached = 0
    while waiting:
        reached += 1
        waiting += nodes[waiting.pop()].get("children", [])
    if reached < len(nodes):
        raise InvalidInput("nodes", f"{len(nodes) - reached} nodes that are below themselves", "a tree")


def _check_transform(place: str, node: Json) -> None:
    for key, count in (("matrix", 16), ("translation", 3), ("rotation", 4), ("scale", 3)):
        values = node.get(key)
        if values is None:
            continue
        plain = isinstance(values, list) and len(values) == count
        # Integers of many digits can be compared, but not converted to floats.
        if not plain or not all(isinstance(one, int | float) and -1e30 <= one <= 1e30 for one in values):
            raise InvalidInput(f"{place}/{key}", repr(values)[:80], f"{count} numbers from -1e30 to 1e30")
