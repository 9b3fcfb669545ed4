"""Import of untrusted meshes in all accepted formats, detected by content."""

import io
import re
import struct
from dataclasses import dataclass

import numpy as np
import trimesh
from trimesh.visual import ColorVisuals

from bentray_kernels.arrays import Floats
from bentray_kernels.errors import InvalidInput
from bentray_kernels.meshes.defects import SoundMesh, sound

from .damage import first_bytes, rejecting_damage
from .mesh_checks import OFF_HEADERS, check_gltf, plain_obj, plain_off

ACCEPTED = "a triangle mesh as PLY, OBJ, OFF, STL, glTF or GLB"

LARGEST_BYTES = 256 * 2**20
MAX_FACES = 2_000_000

# Written before text by some editors.
BYTE_ORDER_MARK = b"\xef\xbb\xbf"


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
    given = f"{kind.upper()} data that are truncated, damaged, or inconsistent with the header"
    with rejecting_damage("file", f"a whole {kind.upper()} file", given=given):
        if kind in ("gltf", "glb"):
            check_gltf(data, kind)
        elif kind == "off":
            data = plain_off(data)
        elif kind == "obj":
            data = plain_obj(data)
        # Images of materials would have to be decoded.
        loaded = trimesh.load_scene(io.BytesIO(data), file_type=kind, process=False, skip_materials=True)
        instances = [loaded.geometry[loaded.graph[node][1]] for node in loaded.graph.nodes_geometry]
        faces = sum(len(getattr(instance, "faces", ())) for instance in instances)
        if faces > MAX_FACES:
            raise InvalidInput("faces", faces, f"at most {MAX_FACES}")
        mesh = loaded.to_mesh()
        surface = sound(np.asarray(mesh.vertices), np.asarray(mesh.faces))
    return ReadMesh(kind, surface, _colours(mesh, surface))


def _kind(data: bytes) -> str:
    start = data[:512].lstrip()
    if data.startswith(b"glTF"):
        return "glb"
    if start.startswith(b"{"):
        return "gltf"
    if data.startswith(b"ply"):
        return "ply"
    if start.split(maxsplit=1)[:1] and start.split(maxsplit=1)[0] in OFF_HEADERS:
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
    content = f"a file of another kind ({first_bytes(data)})"
    if not data:
        content = "an empty file"
    elif as_stl and not text:
        content += f"; or a binary STL of {len(data)} bytes, where its header means {as_stl}"
    raise InvalidInput("file", content, ACCEPTED)


def _colours(mesh: trimesh.Trimesh, surface: SoundMesh) -> Floats | None:
    visual = mesh.visual
    if not isinstance(visual, ColorVisuals) or visual.kind != "vertex":
        return None
    colours = np.asarray(visual.vertex_colors)[surface.origin, :3]
    return colours.astype(np.float64) / 255.0
