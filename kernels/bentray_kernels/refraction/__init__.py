"""Refractive rendering of volumes before a backdrop: optics, cameras, ray caster and supersampling."""

from .backdrop import Backdrop, Plane, backdrop_of, checkerboard
from .camera import Camera, orthographic, perspective
from .render import Picture, RenderSettings, render
from .scene import Layers, Scene
from .shading import Light, Shaded, shade

__all__ = [
    "Backdrop",
    "Camera",
    "Layers",
    "Light",
    "Picture",
    "Plane",
    "RenderSettings",
    "Scene",
    "Shaded",
    "backdrop_of",
    "checkerboard",
    "orthographic",
    "perspective",
    "render",
    "shade",
]
