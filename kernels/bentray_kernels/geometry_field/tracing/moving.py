"""Objects of a scene in other places, without packing the scene again."""

from __future__ import annotations

import numpy as np

from ...errors import InvalidInput
from .packed_scene import World
from .scene import Scene


def moved(world: World, scene: Scene) -> World:
    """The packed scene with its instances where those of another scene are; all tables are shared.

    Args:
        world: ``packed_scene.world_of`` of a scene with the same shapes and materials in the same order.
        scene: where its instances are.

    Raises:
        InvalidInput: for another number of instances.
    """
    if len(scene.instances) != len(world.to_world):
        raise InvalidInput(
            "instances", len(scene.instances), f"{len(world.to_world)}, as in the packed scene"
        )
    to_world = np.array([instance.to_world for instance in scene.instances], dtype=np.float64)
    back = np.linalg.inv(to_world[:, :, :3])
    to_local = np.concatenate([back, -back @ to_world[:, :, 3:]], axis=2)
    return world._replace(to_world=to_world, to_local=to_local)
