"""Geometry fields: tables that tell where a ray meets a mesh, and pictures of what mirrors and refracts."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .defects import SoundMesh, sound
    from .geometric_error import GeometricError
    from .geometry_image import GeometryImage
    from .inner_field import InnerField, build_inner_rows, spread_points
    from .mesh import Chart, TriangleMesh
    from .outer_field import OuterField, build_rows, mark_borders
    from .parameterisation import Parameterisation, parameterise
    from .scene import Ground, Instance, Material, Scene, Shape, placed
    from .subsampling import FittedImage, fitted_image
    from .surface import Surface, surface_of
    from .tracing import TraceSettings, trace
    from .world import World, world_of

# Functions with the name of their module, as ``geometry_image.geometry_image``, are to be had from there.
__all__ = [
    "Chart",
    "FittedImage",
    "GeometricError",
    "GeometryImage",
    "Ground",
    "InnerField",
    "Instance",
    "Material",
    "OuterField",
    "Parameterisation",
    "Scene",
    "Shape",
    "SoundMesh",
    "Surface",
    "TraceSettings",
    "TriangleMesh",
    "World",
    "build_inner_rows",
    "build_rows",
    "fitted_image",
    "mark_borders",
    "parameterise",
    "placed",
    "sound",
    "spread_points",
    "surface_of",
    "trace",
    "world_of",
]

# Imported when they are asked for: who only reads a mesh needs no libigl.
_MODULES = {
    "defects": ("SoundMesh", "sound"),
    "geometric_error": ("GeometricError",),
    "geometry_image": ("GeometryImage",),
    "inner_field": ("InnerField", "build_inner_rows", "spread_points"),
    "mesh": ("Chart", "TriangleMesh"),
    "outer_field": ("OuterField", "build_rows", "mark_borders"),
    "parameterisation": ("Parameterisation", "parameterise"),
    "scene": ("Ground", "Instance", "Material", "Scene", "Shape", "placed"),
    "subsampling": ("FittedImage", "fitted_image"),
    "surface": ("Surface", "surface_of"),
    "tracing": ("TraceSettings", "trace"),
    "world": ("World", "world_of"),
}
_PLACES = {name: module for module, names in _MODULES.items() for name in names}


def __getattr__(name: str) -> Any:
    if name not in _PLACES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f".{_PLACES[name]}", __name__), name)
