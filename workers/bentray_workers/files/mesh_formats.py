"""Import of untrusted meshes in all accepted formats, detected by content."""

from __future__ import annotations

import io
import json
import re
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
import trimesh
from trimesh.visual import ColorVisuals

from bentray_kernels.arrays import Floats
from bentray_kernels.errors import InvalidInput
from bentray_kernels.meshes.defects import SoundMesh, sound

from .damage import first_bytes, rejecting_damage
from .gltf_checks import check_gltf
from .obj_checks import plain_obj
from .off_checks import HEADERS, check_off

ACCEPTED = "a triangle mesh as PLY, OBJ, OFF, STL, glTF or GLB"

LARGEST_BYTES = 256 * 2**20
MAX_FACES = 2_000_000

# Written before text by some editors.
BYTE_ORDER_MARK = b"\xef\xbb\xbf"

# Chunks of GLB: JSON, "JSON" in little-endian.
GLB_HEADER = struct.Struct("<4sII")
GLB_CHUNK = struct.Struct("<I4s")

# Fields of glTF for appearance and animation, which are not used; images would have to be decoded.
MATERIALS = ("images", "textures", "samplers", "materials", "animations", "skins", "cameras")


@dataclass(frozen=True)
class ReadMesh:
    """A mesh from a file.

    Attributes:
        format: as ``trimesh`` names it.
        surface: the mesh with its repairs.
        colours: (vertices, 3) in [0, 1], or None without colours of vertices.
    """

    format: str
    surface: SoundMesh
    colours: Floats | None


def read_mesh(data: bytes) -> ReadMesh:
    """Read a mesh in any of the formats; other files are never read.

    Polygons become triangles, the parts of a glTF scene one mesh. Coincident vertices are merged (STL repeats
    them for each face), and faces of inconsistent orientation are flipped.

    Args:
        data: the whole file.

    Raises:
        InvalidInput: for other formats, more than ``LARGEST_BYTES`` or ``MAX_FACES``, damaged data, glTF
            that refers to other files, and as ``meshes.defects.sound``.
    """
    if len(data) > LARGEST_BYTES:
        raise InvalidInput("file", f"{len(data)} bytes", f"at most {LARGEST_BYTES} bytes")
    data = data.removeprefix(BYTE_ORDER_MARK)
    kind = _kind(data)
    if kind in ("gltf", "glb"):
        data = _without_materials(data, kind)
    if kind == "off":
        check_off(data)
    if kind == "obj":
        with _whole(kind):
            data = plain_obj(data)
    with _whole(kind):
        loaded = trimesh.load_scene(io.BytesIO(data), file_type=kind, process=False)
        mesh = loaded.to_mesh()
        faces, vertices = np.asarray(mesh.faces), np.asarray(mesh.vertices)
    if len(faces) > MAX_FACES:
        raise InvalidInput("faces", len(faces), f"at most {MAX_FACES}")
    surface = sound(vertices, faces)
    return ReadMesh(kind, surface, _colours(mesh, surface))


def _kind(data: bytes) -> str:
    start = data[:512].lstrip()
    if data.startswith(b"glTF"):
        return "glb"
    if start.startswith(b"{"):
        return "gltf"
    if data.startswith(b"ply"):
        return "ply"
    if start.split(maxsplit=1)[:1] and start.split(maxsplit=1)[0] in HEADERS:
        return "off"
    # Binary STL begins with any 80 bytes, even with "solid"; it is detected by its length.
    as_stl = 84 + 50 * struct.unpack_from("<I", data, 80)[0] if len(data) >= 84 else 0
    if as_stl and as_stl == len(data):
        return "stl"
    if start.lower().startswith(b"solid") and b"facet" in data[:4096].lower():
        if b"endsolid" not in data.lower():
            raise InvalidInput("file", "an STL of words without its end (endsolid)", "a whole STL file")
        return "stl"
    text = b"\0" not in data[: 2**16]
    if text and re.search(rb"^v[ \t]", data, re.MULTILINE):
        return "obj"
    found = f"a file of another kind ({first_bytes(data)})"
    if not data:
        found = "an empty file"
    elif as_stl and not text:
        found += f"; or a binary STL of {len(data)} bytes, where its header means {as_stl}"
    raise InvalidInput("file", found, ACCEPTED)


@contextmanager
def _whole(kind: str) -> Iterator[None]:
    """Convert errors of trimesh on damaged data to messages about the file."""
    try:
        with rejecting_damage("file", f"a whole {kind.upper()} file"):
            yield
    except InvalidInput as error:
        if not error.value.startswith("damaged data"):
            raise
        found = f"{kind.upper()} data that are truncated, damaged, or inconsistent with the header"
        raise InvalidInput("file", found, error.accepted) from None


def _without_materials(data: bytes, kind: str) -> bytes:
    """The same glTF without images and materials, after checking that it refers to no other file."""
    with _whole(kind):
        rest = b""
        text = data
        if kind == "glb":
            length, name = GLB_CHUNK.unpack_from(data, GLB_HEADER.size)
            begin = GLB_HEADER.size + GLB_CHUNK.size
            text, rest = data[begin : begin + length], data[begin + length :]
            if name != b"JSON" or len(text) < length:
                raise InvalidInput("file", f"a first chunk {name!r}", "JSON, as a whole")
        scene = json.loads(text)
        outside = [buffer["uri"] for buffer in scene.get("buffers", []) if not _inside(buffer)]
        if outside:
            # The name may be that of any file of this machine; it is not repeated.
            raise InvalidInput("buffers/uri", "data in another file", "data within the file")
        check_gltf(scene, len(data), MAX_FACES)
        stripped = json.dumps(_stripped(scene)).encode()
    if kind == "gltf":
        return stripped
    stripped += b" " * (-len(stripped) % 4)
    total = GLB_HEADER.size + GLB_CHUNK.size + len(stripped) + len(rest)
    return GLB_HEADER.pack(b"glTF", 2, total) + GLB_CHUNK.pack(len(stripped), b"JSON") + stripped + rest


def _inside(buffer: dict[str, Any]) -> bool:
    return "uri" not in buffer or buffer["uri"].startswith("data:")


def _stripped(scene: dict[str, Any]) -> dict[str, Any]:
    for mesh in scene.get("meshes", []):
        for primitive in mesh["primitives"]:
            primitive.pop("material", None)
    return {name: value for name, value in scene.items() if name not in MATERIALS}


def _colours(mesh: trimesh.Trimesh, surface: SoundMesh) -> Floats | None:
    visual = mesh.visual
    if not isinstance(visual, ColorVisuals) or visual.kind != "vertex":
        return None
    colours = np.asarray(visual.vertex_colors)[surface.origin, :3]
    return colours.astype(np.float64) / 255.0
