"""Mitsuba 3's ``sdfgrid`` before a checkerboard: its frames, and where its rays end."""

from collections.abc import Callable

import numpy as np

from ._refracting_ball import CAMERA_Z, INDEX, NODES, PIXELS, SCREEN_Z, SQUARES, WIDTH, ray_starts


class Mitsuba:
    """One thread of the LLVM back end.

    Args:
        module: ``mitsuba``.

    Raises:
        ImportError: when it finds no LLVM library (``DRJIT_LIBLLVM_PATH`` names one).
    """

    def __init__(self, module) -> None:
        import drjit

        self.mi, self.drjit = module, drjit
        try:
            module.set_variant("llvm_ad_rgb")
            drjit.set_thread_count(0)
            drjit.eval(module.Float(0.0) + drjit.arange(module.Float, 2))
        except RuntimeError as error:
            raise ImportError(str(error).splitlines()[0]) from error

    def scene(self, volume: np.ndarray, iso: float, scale: float):
        """A ball of glass: ``scale`` makes distances, in nodes, of the volume's values."""
        mi, transform = self.mi, self.mi.ScalarTransform4f
        edge = NODES - 1.0
        # Distances are negative inside, in edges of the cube; the first axis of the grid is z.
        grid = np.ascontiguousarray(
            ((iso - volume) * scale / edge).transpose(2, 1, 0)[..., None], dtype=np.float32
        )
        return mi.load_dict(
            {
                "type": "scene",
                "integrator": {"type": "path", "max_depth": 6},
                "ball": {
                    "type": "sdfgrid",
                    "normals": "smooth",
                    "grid": mi.TensorXf(grid),
                    "bsdf": {"type": "dielectric", "int_ior": INDEX, "ext_ior": 1.0},
                    "to_world": transform().scale(edge).translate([-0.5] * 3),
                },
                "board": {
                    "type": "rectangle",
                    "to_world": transform()
                    .translate([0, 0, SCREEN_Z])
                    .rotate([0, 1, 0], 180)
                    .scale(8 * WIDTH),
                    "emitter": {
                        "type": "area",
                        "radiance": {"type": "checkerboard", "to_uv": transform().scale(8 * SQUARES)},
                    },
                },
                "sensor": {
                    "type": "orthographic",
                    "to_world": transform()
                    .look_at([0, 0, CAMERA_Z], [0, 0, 0], [0, -1, 0])
                    .scale(0.5 * WIDTH),
                    "film": {
                        "type": "hdrfilm",
                        "width": PIXELS,
                        "height": PIXELS,
                        "rfilter": {"type": "box"},
                    },
                },
            }
        )

    def frame(self, scene, samples: int) -> Callable[[], object]:
        """Renders one frame, as far as an array in memory."""
        return lambda: np.array(self.mi.render(scene, spp=samples))

    def ends(self, scene) -> np.ndarray:
        """(pixels², 2) where rays end that go in and out of the ball once, NaN for those that do not."""
        mi, start = self.mi, ray_starts().astype(np.float32)
        ray = mi.Ray3f(mi.Point3f(start[:, 0], start[:, 1], CAMERA_Z), mi.Vector3f(0.0, 0.0, 1.0))
        entry = scene.ray_intersect(ray)
        inside = entry.spawn_ray(self._refracted(ray.d, entry, 1.0 / INDEX))
        leaving = scene.ray_intersect(inside)
        out = self._refracted(inside.d, leaving, INDEX)
        end = leaving.p + out * ((SCREEN_Z - leaving.p.z) / out.z)
        points = np.array(end).T[:, :2].astype(float)
        through = (np.array(entry.p.z) < SCREEN_Z - 1) & (np.array(leaving.p.z) < SCREEN_Z - 1)
        return np.where((through & (np.array(out.z) > 0.0))[:, None], points, np.nan)

    def _refracted(self, direction, surface, ratio: float):
        dr, normal = self.drjit, surface.sh_frame.n
        normal = dr.select(dr.dot(direction, normal) > 0.0, -normal, normal)
        cosine = -dr.dot(direction, normal)
        behind = dr.sqrt(dr.maximum(1.0 - ratio * ratio * (1.0 - cosine * cosine), 0.0))
        return ratio * direction + (ratio * cosine - behind) * normal
