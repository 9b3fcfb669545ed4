"""Exact ray-mesh intersectors, one thread each: Embree through three packages, and ours."""

from collections.abc import Callable

import numpy as np

from bentray_kernels.meshes.intersector import intersect
from bentray_kernels.meshes.mesh import TriangleMesh
from bentray_kernels.meshes.surface import Surface

Run = Callable[[], object]


class Ours:
    """Double precision, compiled by numba."""

    def __init__(self, surface: Surface) -> None:
        self.surface = surface

    def run(self, origins: np.ndarray, directions: np.ndarray) -> Run:
        """Intersects rays, (n, 3) each."""
        return lambda: self.first(origins, directions)

    def first(self, origins: np.ndarray, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Faces, −1 for none, and distances in lengths of the direction."""
        n = len(origins)
        none, faces, distances = np.full(n, -1, np.int32), np.empty(n, np.int32), np.empty(n)
        weights, outside = np.empty((n, 2)), np.empty(n, dtype=bool)
        rays = np.float64(origins), np.float64(directions)
        intersect(self.surface, *rays, none, faces, distances, weights, outside)
        return faces, distances


def embreex_of(module) -> Callable[[TriangleMesh], object]:
    """Adapter of ``embreex``."""
    from embreex import rtcore_scene
    from embreex.mesh_construction import TriangleMesh as Triangles

    class Embreex:
        def __init__(self, mesh: TriangleMesh) -> None:
            self.scene = rtcore_scene.EmbreeScene()
            self.mesh = Triangles(self.scene, mesh.corners.astype(np.float32))

        def run(self, origins: np.ndarray, directions: np.ndarray) -> Run:
            rays = np.ascontiguousarray(origins, np.float32), np.ascontiguousarray(directions, np.float32)
            return lambda: self.scene.run(*rays, query="INTERSECT")

    return Embreex


def open3d_of(module) -> Callable[[TriangleMesh], object]:
    """Adapter of ``open3d``."""

    class Open3D:
        def __init__(self, mesh: TriangleMesh) -> None:
            self.scene = module.t.geometry.RaycastingScene(nthreads=1)
            self.scene.add_triangles(
                module.core.Tensor(mesh.vertices.astype(np.float32)),
                module.core.Tensor(mesh.faces.astype(np.uint32)),
            )

        def run(self, origins: np.ndarray, directions: np.ndarray) -> Run:
            rays = module.core.Tensor(np.hstack([origins, directions]).astype(np.float32))
            return lambda: self.scene.cast_rays(rays, nthreads=1)

    return Open3D


def mitsuba_of(module) -> Callable[[TriangleMesh], object]:
    """Adapter of ``mitsuba``: only the hit, without its surface properties.

    Raises:
        ImportError: when it finds no LLVM library (``DRJIT_LIBLLVM_PATH`` names one).
    """
    import drjit

    try:
        module.set_variant("llvm_ad_rgb")
        drjit.set_thread_count(0)
        drjit.eval(drjit.arange(module.Float, 2))
    except RuntimeError as error:
        raise ImportError(str(error).splitlines()[0]) from error

    class Mitsuba:
        def __init__(self, mesh: TriangleMesh) -> None:
            shape = module.Mesh("mesh", len(mesh.vertices), len(mesh.faces))
            parameters = module.traverse(shape)
            parameters["vertex_positions"] = mesh.vertices.astype(np.float32).ravel()
            parameters["faces"] = mesh.faces.astype(np.uint32).ravel()
            parameters.update()
            self.scene = module.load_dict({"type": "scene", "mesh": shape})

        def run(self, origins: np.ndarray, directions: np.ndarray) -> Run:
            o, d = (np.ascontiguousarray(a.T, np.float32) for a in (origins, directions))
            ray = module.Ray3f(module.Point3f(o), module.Vector3f(d))
            drjit.eval(ray)

            def once() -> None:
                hit = self.scene.ray_intersect_preliminary(ray)
                drjit.eval(hit)
                drjit.sync_thread()

            return once

    return Mitsuba


PEERS = {
    "embreex": ("embreex", embreex_of),
    "Open3D": ("open3d", open3d_of),
    "Mitsuba": ("mitsuba", mitsuba_of),
}
