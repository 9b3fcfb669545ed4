"""A scene for compiled functions: the concatenated arrays of all shapes."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...arrays import Float32s, Floats, Int32s, Ints
from ...errors import InvalidInput
from ...meshes.surface import Surface
from ..tables.agreement import agreement
from .scene import Scene, Shape

# Flags of an instance.
SEES_ITSELF, SINGLE = 1, 2

# Face, −1 for none; distance in lengths of the direction; weights of corners 0 and 1, or u and v of the
# geometry image where the last is true.
Hit = tuple[int, float, float, float, bool]


class World(NamedTuple):
    """Faces and nodes are counted through all shapes.

    Attributes:
        surface: the surfaces of all shapes.
        shapes: (shapes, 5): first node; samples of the outer field, 0 for none, and the place of its first
            entry; the same of the inner field.
        faces, fractions: all outer tables.
        known: ``tables.agreement.agreement`` of them.
        inner_faces: all inner tables.
        starts: (faces,) row of the inner table in which rays that leave a face are.
        references: (shapes, 4): place of the first number of the table of (u, v), and of the geometry image;
            pixels along a side of it, 0 for no reference field; place of the first number of the inner table
            of (u, v), −1 for none.
        uv, images, inner_uv: all tables of (u, v), all geometry images, and all inner tables of (u, v).
        to_local: (instances, 3, 4) from m to the unit cube.
        to_world: (instances, 3, 4) from the unit cube to m.
        instances: (instances, 3): shape; texture, −1 for none; flags.
        looks: (instances, 6): RGB, share mirrored, share refracted, refractive index.
        pictures: all textures.
        textures: (textures, 3): place of the first number, rows, columns.
        sky: (rows, columns, 3).
        ground: (9,): height; edge of the squares, 0 for no ground; RGB of both kinds; radius.
        light: (4,): unit vector towards the light; ambient share.
    """

    surface: Surface
    shapes: Ints
    faces: Int32s
    fractions: Float32s
    known: NDArray[np.uint8]
    inner_faces: Int32s
    starts: Int32s
    references: Ints
    uv: Float32s
    images: Float32s
    inner_uv: Float32s
    to_local: Floats
    to_world: Floats
    instances: Ints
    looks: Floats
    pictures: Float32s
    textures: Ints
    sky: Float32s
    ground: Floats
    light: Floats


def world_of(scene: Scene) -> World:
    """All arrays of a scene; those of a single shape are not copied."""
    shapes = list({id(instance.shape): instance.shape for instance in scene.instances}.values())
    first_face = np.cumsum([0] + [len(shape.surface.triangles) for shape in shapes])
    first_node = np.cumsum([0] + [len(shape.surface.nodes) for shape in shapes])
    # Of the shapes that have them: their fields, with the number of their first face.
    outers = [(shape.outer, k) for shape, k in zip(shapes, first_face, strict=False) if shape.outer]
    inners = [(shape.inner, k) for shape, k in zip(shapes, first_face, strict=False) if shape.inner]
    recorded = [shape.reference for shape in shapes if shape.reference]
    table, outer, inner = [], 0, 0
    references, of_uv, of_images, of_inner_uv = [], 0, 0, 0
    for shape, node in zip(shapes, first_node, strict=False):
        of_outer = (shape.outer.samples, outer) if shape.outer else (0, 0)
        of_inner = (shape.inner.samples, inner) if shape.inner else (0, 0)
        table.append((node, *of_outer, *of_inner))
        outer += shape.outer.faces.size if shape.outer else 0
        inner += shape.inner.faces.size if shape.inner else 0
        within = shape.reference.inner_uv if shape.reference else None
        pixels = len(shape.reference.image) if shape.reference else 0
        references.append((of_uv, of_images, pixels, -1 if within is None else of_inner_uv))
        of_uv += shape.reference.uv.size if shape.reference else 0
        of_images += shape.reference.image.size if shape.reference else 0
        of_inner_uv += 0 if within is None else within.size
    starts = [
        shape.inner.starts if shape.inner else np.zeros(len(shape.surface.triangles), np.int32)
        for shape in shapes
    ]
    numbers = {id(shape): number for number, shape in enumerate(shapes)}
    textures: list[Any] = []
    first_number = [0]
    instances, looks = [], []
    for instance in scene.instances:
        material = instance.material
        number = -1
        if material.texture is not None:
            number = len(textures)
            textures.append(np.asarray(material.texture, dtype=np.float32))
            first_number.append(first_number[-1] + textures[-1].size)
        flags = SEES_ITSELF * material.self_reflection + SINGLE * (material.refraction == "single")
        instances.append((numbers[id(instance.shape)], number, flags))
        looks.append((*material.colour, material.mirror, material.glass, material.index))
    places = [(start, *texture.shape[:2]) for start, texture in zip(first_number, textures, strict=False)]
    to_local, to_world = _transforms(scene)
    light = np.asarray(scene.light) / np.linalg.norm(scene.light)
    ground = np.zeros(9)
    if scene.ground:
        ground[:2], ground[8] = (scene.ground.height_m, scene.ground.square_m), scene.ground.radius_m
        ground[2:8] = np.ravel(scene.ground.colours)
    return World(
        surface=_together(shapes, first_face, first_node),
        shapes=np.array(table, dtype=np.int64),
        faces=_shifted([(field.faces, k) for field, k in outers]),
        fractions=_joined([field.fractions for field, _ in outers], np.float32),
        known=_joined([agreement(field) for field, _ in outers], np.uint8),
        inner_faces=_shifted([(field.faces, k) for field, k in inners]),
        starts=np.concatenate(starts),
        references=np.array(references, dtype=np.int64),
        uv=_joined([field.uv for field in recorded], np.float32),
        images=_joined([field.image for field in recorded], np.float32),
        inner_uv=_joined([field.inner_uv for field in recorded if field.inner_uv is not None], np.float32),
        to_local=to_local,
        to_world=to_world,
        instances=np.array(instances, dtype=np.int64),
        looks=np.array(looks, dtype=np.float64),
        pictures=_joined(textures, np.float32),
        textures=np.array(places, dtype=np.int64).reshape(-1, 3),
        sky=np.ascontiguousarray(scene.environment, dtype=np.float32),
        ground=ground,
        light=np.array([*light, scene.ambient]),
    )


def moved(world: World, scene: Scene) -> World:
    """The packed scene with its instances where those of another scene are; all tables are shared.

    Args:
        world: ``world_of`` a scene with the same shapes and materials in the same order.
        scene: where its instances are.

    Raises:
        InvalidInput: for another number of instances.
    """
    number = len(world.to_world)
    if len(scene.instances) != number:
        raise InvalidInput("instances", len(scene.instances), f"{number}, as in the packed scene")
    to_local, to_world = _transforms(scene)
    return world._replace(to_local=to_local, to_world=to_world)


def _transforms(scene: Scene) -> tuple[Floats, Floats]:
    """``to_local`` and ``to_world`` of a scene's instances."""
    to_world = np.array([instance.to_world for instance in scene.instances], dtype=np.float64)
    back = np.linalg.inv(to_world[:, :, :3])
    return np.concatenate([back, -back @ to_world[:, :, 3:]], axis=2), to_world


def _joined(arrays: Sequence[Any], kind: Any) -> Any:
    if len(arrays) == 1:
        return np.ravel(arrays[0])
    return np.concatenate([np.ravel(array) for array in arrays] or [np.zeros(1, dtype=kind)])


def _shifted(tables: Sequence[tuple[Int32s, int]]) -> Int32s:
    """Tables of faces, counted through all shapes."""
    moved = [
        table if by == 0 else table + np.int32(by) * ((table >= 0).astype(np.int32) - (table < -1))
        for table, by in tables
    ]
    joined: Int32s = _joined(moved, np.int32)
    return joined


def _together(shapes: Sequence[Shape], first_face: Ints, first_node: Ints) -> Surface:
    surfaces = [shape.surface for shape in shapes]
    if len(surfaces) == 1:
        return surfaces[0]
    joined = Surface(*(np.concatenate(parts) for parts in zip(*surfaces, strict=True)))
    triangles, nodes = joined.triangles, joined.nodes
    links, children = triangles.view(np.int32), nodes.view(np.int32)
    for k in range(len(shapes)):
        own = links[first_face[k] : first_face[k + 1], 9:12]
        own[own >= 0] += np.int32(first_face[k])
        child = children[first_node[k] : first_node[k + 1], 12:14]
        leaf = child < 0
        child[leaf] -= np.int32(8 * first_face[k])
        child[~leaf] += np.int32(first_node[k])
    return joined._replace(links=links, children=children)
