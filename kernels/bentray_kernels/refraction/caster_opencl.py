"""The ray caster on an OpenCL device: the same rays as ``caster.cast``, one work-item each."""

from __future__ import annotations

import warnings
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats
from ..errors import InvalidInput
from ..isosurface import crossing
from ..isosurface.crossing import Search
from ..isosurface.roots import STEPS
from ..opencl import OpenCLFallbackWarning, Session, session_or_warning
from ..opencl.session import set_arguments
from .caster import Medium, Traced, cast, medium_of, space_for
from .scene import Scene

Precision = Literal["float64", "float32"]

# Rays of a work-group.
GROUP = 64

# How the kernel names the ways to look within a cell, by ``Search.roots``.
WITHIN_CELLS = {crossing.CERTAIN: "CERTAIN", crossing.BRENT: "BRENT", crossing.ANALYTIC: "ANALYTIC"}

# Accuracy of a crossing and the shortest piece of a ray that is halved, nodes. A float resolves 1e-4 nodes a
# thousand nodes from the camera.
FINENESS = {"float64": (crossing.TOLERANCE, crossing.SHORTEST), "float32": (1e-4, 1e-3)}

# Rays that are compared with the CPU before a device is believed, and how many interfaces they may meet: where
# light bends often, what is rounded differently grows at each of them.
TRIED, TRIED_DEPTH = 256, 4

# How far a direction may be off by then, and the share of rays that may be off farther. Grazing rays and those
# that pass close to an edge of the object go either way.
TOLERANCES = {"float64": (1e-6, 0.02), "float32": (2e-2, 0.1)}


class OpenCLCaster:
    """A scene kept on a device. What the device gets wrong in its trial, ``cast`` does instead.

    Args:
        scene: its volume and octree are copied to the device once.
        session: the device.
        precision: of all numbers on the device. "float32" finds crossings to 1e-4 nodes in place of 1e-8.

    Raises:
        InvalidInput: for another precision.
    """

    def __init__(self, scene: Scene, session: Session, precision: Precision = "float64") -> None:
        if precision not in FINENESS:
            raise InvalidInput("precision", precision, "one of " + ", ".join(FINENESS))
        self.scene = scene
        self.session = session
        self.precision = precision
        self._real: Any = np.dtype(precision)
        # Sums are in the type of the coefficients, on the device as on the CPU.
        self._sum: Any = min(self._real, scene.field.coefficients.dtype, key=lambda kind: kind.itemsize)
        self._faults: dict[str, str] = {}
        with session.lock:
            self._coefficients = self._upload(scene.field.coefficients, self._sum)
            self._tables = self._upload(scene.field.stencil.weights, self._sum)
            self._masks = session.upload(scene.octree.masks)
            self._bend = session.upload(scene.octree.bend)
            self._shapes = self._upload(scene.octree.levels, np.dtype(np.int64))

    def cast(
        self,
        medium: Medium,
        search: Search,
        camera: tuple[Floats, Floats],
        places: Floats,
        depth: int,
        traced: Traced,
    ) -> None:
        """As ``caster.cast``.

        Raises:
            InvalidInput: for the medium of another scene.

        Warns:
            OpenCLFallbackWarning: once for each way to look for crossings, where the device fails its trial
                and ``caster.cast`` follows the rays instead.
        """
        if medium.field is not self.scene.field:
            raise InvalidInput("medium", "of another scene", "a medium of the scene that is on the device")
        way = _way(search)
        if way not in self._faults:
            self._faults[way] = self.fault_of(medium, search)
            if self._faults[way]:
                message = f"{self.session.handle.name} casts rays wrong ({way.lower()}), cast takes over: "
                warnings.warn(OpenCLFallbackWarning(message + self._faults[way]), stacklevel=2)
        if self._faults[way]:
            cast(medium, search, camera, places, depth, traced)
        else:
            self.follow(medium, search, camera, places, depth, traced)

    def fault_of(self, medium: Medium, search: Search) -> str:
        """How the device differs from ``caster.cast`` in a few rays at the object; empty where it does not."""
        camera, places = _towards(self.scene)
        found, expected = (space_for(TRIED, TRIED_DEPTH, False) for _ in range(2))
        self.follow(medium, search, camera, places, TRIED_DEPTH, found)
        cast(medium, search, camera, places, TRIED_DEPTH, expected)
        far, allowed = TOLERANCES[self.precision]
        same = (found.fate == expected.fate) & (found.crossed == expected.crossed)
        same &= np.abs(found.direction - expected.direction).max(axis=1) <= far
        share = 1.0 - float(same.mean())
        return "" if share <= allowed else f"{share:.0%} of its rays where {allowed:.0%} are allowed"

    def follow(
        self,
        medium: Medium,
        search: Search,
        camera: tuple[Floats, Floats],
        places: Floats,
        depth: int,
        traced: Traced,
    ) -> None:
        """As ``cast``, on the device whatever it computes."""
        kept = traced.vertices.shape[1]
        at_once = max(1, self.session.doubles_at_once() // (12 + 3 * kept))
        for start in range(0, len(places), at_once):
            rays = slice(start, start + at_once)
            part = traced.part(rays) if kept else traced.part(rays)._replace(vertices=traced.vertices)
            self._follow(medium, search, camera, places[rays], depth, part)

    def _follow(
        self,
        medium: Medium,
        search: Search,
        camera: tuple[Floats, Floats],
        places: Floats,
        depth: int,
        traced: Traced,
    ) -> None:
        session, stencil = self.session, medium.field.stencil
        kernel = session.kernel("refraction", "follow", *self._defines(medium, search))
        frame = np.array([medium.origin, medium.density, medium.low, medium.high])
        numbers = [*medium.field.coefficients.shape]
        with session.lock:
            filled = [self._upload(array, self._kind(array)) for array in traced if array.size]
"""
