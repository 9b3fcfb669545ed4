"""Figure of geometry images: positions, normals, reconstructed surface and stretch."""

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection

from bentray_kernels.geometry_field.image.geometry_image import GeometryImage
from bentray_kernels.geometry_field.layout.parameterisation import Parameterisation
from bentray_kernels.meshes.mesh import TriangleMesh
from bentray_workers.images.canvas import drawing, new_figure, to_png

# Where the light comes from, in the axes of the picture: right, up and towards the eye.
LIGHT = np.array((0.4, 0.6, 0.7)) / np.linalg.norm((0.4, 0.6, 0.7))


def picture(images: Mapping[str, tuple[Parameterisation, GeometryImage, np.ndarray]]) -> bytes:
    """PNG: a row for each surface, with its view, (3, 3) right, up and towards the eye."""
    with drawing():
        figure = new_figure(6.0, 1.65 * len(images))
        panels = figure.subplots(len(images), 4, squeeze=False)
        for row, (name, (chart, image, view)) in enumerate(images.items()):
            for axes in panels[row]:
                axes.set_axis_off()
                axes.set_aspect("equal")
            clear = image.valid[..., np.newaxis]
            for axes, values, words in (
                (panels[row, 0], image.positions, f"{name}: positions"),
                (panels[row, 1], 0.5 * (image.normals + 1.0), "normals"),
            ):
                upright = np.where(clear, values, 1.0).clip(0.0, 1.0).transpose(1, 0, 2)
                axes.imshow(upright, origin="lower", interpolation="nearest")
                axes.set_title(words)
            mesh = image.mesh()
            shaded(panels[row, 2], mesh, view)
            panels[row, 2].set_title(f"from {image.size}² pixels")
            stretched(panels[row, 3], chart)
            panels[row, 3].set_title("surface a pixel, log")
        return to_png(figure)


def shaded(axes: Axes, mesh: TriangleMesh, view: np.ndarray) -> None:
    """The faces that look to the eye, the nearest last, as bright as the light meets them."""
    normals = mesh.face_normals / np.maximum(np.linalg.norm(mesh.face_normals, axis=1), 1e-300)[:, np.newaxis]
    corners, facing = mesh.corners @ view.T, normals @ view.T
    order = np.argsort(corners[..., 2].mean(axis=1))
    order = order[facing[order, 2] > 0.0]
    grey = 0.15 + 0.8 * np.maximum(facing[order] @ LIGHT, 0.0)
    colours = np.repeat(grey[:, np.newaxis], 3, axis=1)
    faces = PolyCollection(corners[order, :, :2], facecolors=colours, edgecolors="face", linewidths=0.2)
    axes.add_collection(faces)
    axes.autoscale_view()


def stretched(axes: Axes, layout: Parameterisation) -> None:
    """Each face where it is laid out, dark where a pixel stands for much of the surface."""
    uv = layout.chart.uv
    first, other = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
    flat = 0.5 * np.abs(first[:, 0] * other[:, 1] - first[:, 1] * other[:, 0])
    area = np.linalg.norm(layout.chart.mesh.face_normals, axis=1)
    share = np.log10(area / np.maximum(flat, 1e-300))
    faces = PolyCollection(uv, array=share, cmap="viridis_r", edgecolors="face", linewidths=0.2)
    faces.set_clim(*np.percentile(share, (1, 99)))
    axes.add_collection(faces)
    axes.set_xlim(0.0, 1.0)
    axes.set_ylim(0.0, 1.0)
