"""Refracting volumes before a backdrop: optics, cameras, the ray caster and supersampling."""

from .backdrop import Backdrop, Plane, backdrop_of, checkerboard
from .camera import Camera, orthographic, perspective
from .render import Picture, RenderSettings, render
from .scene import Layers, Scene

__all__ = [
    "Backdrop",
    "Camera",
    "Layers",
    "Picture",
    "Plane",
    "RenderSettings",
    "Scene",
    "backdrop_of",
    "checkerboard",
    "orthographic",
    "perspective",
    "render",
]
