"""Geometry fields: tables that tell where a ray meets a mesh, and pictures of what mirrors and refracts."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .image.geometry_image import GeometryImage
    from .image.subsampling import FittedImage, fitted_image
    from .layout.parameterisation import Parameterisation, parameterise
    from .tables.inner_field import InnerField, build_inner_rows, spread_points
    from .tables.outer_field import OuterField, build_rows, mark_borders
    from .tracing.packed_scene import World, world_of
    from .tracing.ray_tracer import TraceSettings, trace
    from .tracing.scene import Ground, Instance, Material, Scene, Shape, placed

# Functions with the name of their module, as ``geometry_image.geometry_image``, are to be had from there.
__all__ = [
    "FittedImage",
    "GeometryImage",
    "Ground",
    "InnerField",
    "Instance",
    "Material",
    "OuterField",
    "Parameterisation",
    "Scene",
    "Shape",
    "TraceSettings",
    "World",
    "build_inner_rows",
    "build_rows",
    "fitted_image",
    "mark_borders",
    "parameterise",
    "placed",
    "spread_points",
    "trace",
    "world_of",
]

# Imported when they are asked for: who only reads a mesh needs no libigl.
_MODULES = {
    "image.geometry_image": ("GeometryImage",),
    "image.subsampling": ("FittedImage", "fitted_image"),
    "layout.parameterisation": ("Parameterisation", "parameterise"),
    "tables.inner_field": ("InnerField", "build_inner_rows", "spread_points"),
    "tables.outer_field": ("OuterField", "build_rows", "mark_borders"),
    "tracing.packed_scene": ("World", "world_of"),
    "tracing.ray_tracer": ("TraceSettings", "trace"),
    "tracing.scene": ("Ground", "Instance", "Material", "Scene", "Shape", "placed"),
}
_PLACES = {name: module for module, names in _MODULES.items() for name in names}


def __getattr__(name: str) -> Any:
    if name not in _PLACES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f".{_PLACES[name]}", __name__), name)
