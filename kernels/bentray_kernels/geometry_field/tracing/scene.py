"""A scene of meshes: shapes with their fields, instances, materials, ground and environment."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...arrays import Floats
from ...errors import InvalidInput
from ...meshes.surface import Surface
from ..tables.inner_field import InnerField
from ..tables.outer_field import OuterField
from ..tables.reference_field import ReferenceField

REFRACTIONS = ("full", "single")


@dataclass(frozen=True)
class Shape:
    """A surface and its fields, shared by all of its instances.

    Attributes:
        surface: ``surface_of``.
        outer: its outer field; None where rays are to be intersected exactly.
        inner: its inner field; None where rays that leave it are to be intersected exactly.
        reference: its table of (u, v) and geometry image, for the lookups "uv-nearest" and "uv-linear"; None
            where these are to be intersected exactly.

    Raises:
        InvalidInput: for a reference field of other samples than those of the outer field, or of other rows
            than those of the inner one.
    """

    surface: Surface
    outer: OuterField | None = None
    inner: InnerField | None = None
    reference: ReferenceField | None = None

    def __post_init__(self) -> None:
        samples = self.outer.samples if self.outer else 0
        if self.reference and self.reference.samples != samples:
            raise InvalidInput("reference", f"{self.reference.samples} samples", f"those of outer, {samples}")
        within = self.reference.inner_uv if self.reference else None
        entries = self.inner.faces.shape if self.inner else (0, 0)
        if within is not None and within.shape[:2] != entries:
            raise InvalidInput("reference", f"inner_uv {within.shape}", f"entries as inner has, {entries}")


@dataclass(frozen=True)
class Material:
    """Optical properties of a surface: shares of light are mirrored or refracted, the rest is its own colour.

    Attributes:
        colour: RGB, 0 to 1.
        texture: (rows, columns, 3) RGB, 0 to 1, over (u, v) from the upper left, in place of the colour.
        mirror: share that is mirrored.
        glass: share that is refracted.
        index: refractive index over that of the surroundings.
        refraction: "full", at both sides of the body; "single", at the first, and straight on from there.
        self_reflection: whether the surface is reflected in itself.

    Raises:
        InvalidInput: for a number out of range, mirrored and refracted light at once, or another name.
    """

    colour: tuple[float, float, float] = (0.8, 0.8, 0.8)
    texture: Floats | None = None
    mirror: float = 0.0
    glass: float = 0.0
    index: float = 1.5
    refraction: str = "full"
    self_reflection: bool = True

    def __post_init__(self) -> None:
        for name in ("mirror", "glass"):
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise InvalidInput(name, getattr(self, name), "a share from 0 to 1")
        if self.mirror > 0.0 and self.glass > 0.0:
            raise InvalidInput("glass", self.glass, "0 for a surface that mirrors: one ray goes on, not two")
        if not 0.0 < self.index < np.inf:
            raise InvalidInput("index", self.index, "a finite number > 0")
        if self.refraction not in REFRACTIONS:
            raise InvalidInput("refraction", self.refraction, "one of " + ", ".join(REFRACTIONS))
        check_colours("colour", self.colour, 1)
        if self.texture is not None:
            check_colours("texture", self.texture, 3)


@dataclass(frozen=True)
class Instance:
    """A shape put somewhere.

    Attributes:
        shape: which.
        to_world: (3, 4) affine transform of places in its unit cube to m.
        material: what it looks like.

    Raises:
        InvalidInput: for another array, or a transform that flattens or mirrors.
    """

    shape: Shape
    to_world: Floats
    material: Material = field(default_factory=Material)

    def __post_init__(self) -> None:
        matrix = np.asarray(self.to_world, dtype=np.float64)
        if matrix.shape != (3, 4) or not np.isfinite(matrix).all():
            raise InvalidInput("to_world", matrix.shape, "finite (3, 4)")
        if not np.linalg.det(matrix[:, :3]) > 1e-12 * np.abs(matrix[:, :3]).max() ** 3:
            raise InvalidInput("to_world", matrix[:, :3].tolist(), "a transform with determinant > 0")


@dataclass(frozen=True)
class Ground:
    """A horizontal checkerboard, round about the z axis.

    Attributes:
        height_m: its z, m.
        square_m: edge of its squares, m.
        radius_m: m.
        colours: RGB of both kinds of squares, 0 to 1.

    Raises:
        InvalidInput: for a length that is not above 0, or other colours.
    """

    height_m: float
    square_m: float
    radius_m: float
    colours: tuple[tuple[float, float, float], tuple[float, float, float]] = (
        (0.9, 0.9, 0.9),
        (0.25, 0.25, 0.25),
    )

    def __post_init__(self) -> None:
        if not np.isfinite(self.height_m):
            raise InvalidInput("height_m", self.height_m, "a finite height, m")
        for name in ("square_m", "radius_m"):
            if not 0.0 < getattr(self, name) < np.inf:
                raise InvalidInput(name, getattr(self, name), "a finite length > 0 m")
        check_colours("colours", self.colours, 2)


@dataclass(frozen=True)
class Scene:
    """Instances, and what is around them.

    Attributes:
        instances: at least one.
        environment: (rows, columns, 3) RGB, 0 to 1, infinitely far away: rows from the zenith (+z) to the
            nadir, columns round from +x by +y.
        ground: or None.
        light: direction towards the light, any length; it casts no shadow.
        ambient: share of a surface's colour that it shows without light; the rest is Lambert's.

    Raises:
        InvalidInput: without an instance, for another environment, no direction, or a share out of range.
    """

    instances: tuple[Instance, ...]
    environment: NDArray[np.floating]
    ground: Ground | None = None
    light: tuple[float, float, float] = (0.3, -0.5, 0.8)
    ambient: float = 0.3

    def __post_init__(self) -> None:
        if not self.instances:
            raise InvalidInput("instances", "none", "at least one")
        check_colours("environment", self.environment, 3)
        if not 0.0 < float(np.linalg.norm(self.light)) < np.inf:
            raise InvalidInput("light", self.light, "a direction")
        if not 0.0 <= self.ambient <= 1.0:
            raise InvalidInput("ambient", self.ambient, "a share from 0 to 1")


def check_colours(name: str, colours: ArrayLike, dimensions: int) -> None:
    """Raise for what is no array of RGB.

    Raises:
        InvalidInput: for other dimensions, no pixels, not 3 channels, or values beyond 0 and 1.
    """
    values = np.asarray(colours, dtype=np.float64)
    if values.ndim != dimensions or values.shape[-1] != 3 or values.size == 0:
        raise InvalidInput(name, values.shape, f"RGB, {dimensions} dimensions, the last of 3")
    if not ((values >= 0.0) & (values <= 1.0)).all():
        raise InvalidInput(name, f"{values.min():.6g} to {values.max():.6g}", "values from 0 to 1")


def placed(
    centre_m: ArrayLike, size_m: float, axis: ArrayLike = (0.0, 0.0, 1.0), turn_deg: float = 0.0
) -> Floats:
    """The transform that puts the middle of the unit cube somewhere, in a size, turned about an axis.

    Args:
        centre_m: (3,) m.
        size_m: of the cube's edge, m.
        axis: (3,) any length.
        turn_deg: counter-clockwise seen against the axis, degrees.

    Returns:
        (3, 4) as ``Instance.to_world``.
    """
    x, y, z = np.asarray(axis, dtype=np.float64) / np.linalg.norm(axis)
    across = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    angle = np.deg2rad(turn_deg)
    linear = size_m * (np.eye(3) + np.sin(angle) * across + (1.0 - np.cos(angle)) * across @ across)
    centre = np.asarray(centre_m, dtype=np.float64)
    return np.column_stack([linear, centre - linear @ np.full(3, 0.5)])
