"""Future work of chapter 4 (4.7): rays in the filtered volume against rays through a triangulation of it."""

import math
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numba
import numpy as np

from bentray_kernels.arrays import Floats
from bentray_kernels.meshes.intersector import WAITING, closest
from bentray_kernels.meshes.mesh import Chart, TriangleMesh
from bentray_kernels.meshes.surface import Surface, surface_of
from bentray_kernels.refraction import Backdrop, Camera, Layers, RenderSettings, Scene, render
from bentray_kernels.refraction.backdrop import locate
from bentray_kernels.refraction.caster import REFRACTED
from bentray_kernels.refraction.coarse_rays import Hits
from bentray_kernels.refraction.optics import refracted
from bentray_kernels.refraction.supersampling import point_colours
from bentray_kernels.splines import Spline
from bentray_service.cli.output.benchmark_context import BenchmarkContext
from bentray_service.cli.output.benchmark_row import Row

from ..shared._available import available
from ..shared._pictures import Panel, sheet
from ..shared._timing import alternate
from ._refracting_ball import (
    DISTANCE_RADIUS,
    INDEX,
    PIXELS,
    RIM_RADIUS,
    board,
    camera,
    exact,
    signed_distance,
)
from ._refracting_ball import eight_bit as eight_bit_ball
from ._refraction_ladders import subjects

# Samples of the filtered volume per node and axis, between which triangles are flat. A teapot with four has
# 0.7 billion samples.
FINENESS, FINENESS_OF_LARGE = (1, 2, 4), (1, 2)

# A ray meets no face nearer than this to where it starts, edges of the cube: its start is rounded.
AHEAD = 1e-6

REPEATS = 9
SETTINGS = RenderSettings(PIXELS, PIXELS, supersampling="none")


@dataclass(frozen=True)
class Case:
    """A volume, how it is looked at, and where rays through the object that it stands for end.

    Attributes:
        name: for the rows.
        spline: the filtered volume.
        iso: of its surface.
        camera, backdrop: in units of the distance between nodes.
        truth: (pixels², 2) places on the backdrop, NaN where they are not compared; None: those of direct
            rays, as the filtered volume itself is the object.
        fineness: of the triangulations.
    """

    name: str
    spline: Spline
    iso: float
    camera: Camera
    backdrop: Backdrop
    truth: Floats | None
    fineness: tuple[int, ...] = FINENESS


class Frame(NamedTuple):
    """A picture, and where refracted rays end on the backdrop, (pixels², 2), nodes, NaN for others."""

    image: np.ndarray
    ends: Floats


class Triangulation(NamedTuple):
    """A mesh in the unit cube, and where the cube is: its lowest corner and its edge, nodes."""

    surface: Surface
    corner: Floats
    edge: float


def rows(context: BenchmarkContext) -> Iterable[Row]:
    """Error and processor time of triangulations over those of direct rays, and a picture."""
    peers, missing = available(
        {
            "scikit-image": ("skimage.measure", lambda module: module.marching_cubes),
            "Embree": ("embreex.rtcore_scene", lambda module: module),
        }
    )
    pictures, chosen = [], cases()[: 1 if context.quick else None]
    for number, case in enumerate(chosen):
        context.progress(number, len(chosen), case.name)
        if missing:
            for k in case.fineness:
                yield from (
                    Row(label, None, 1.0, ">=", "", "; ".join(missing.values())) for label in labels(case, k)
                )
            continue
        panels, found = compared(case, peers, 3 if context.quick else REPEATS)
        pictures.append((f"{case.name}: direct rays, and rays through triangulations".capitalize(), panels))
        yield from found
    context.save_picture("triangulation.png", lambda: sheet(pictures))


def cases() -> list[Case]:
    """Two balls, whose rays are known, and the teapot where its volume is at hand."""
    balls = [
        Case(name, spline, iso, camera(), board(), np.where(*masked(*exact(radius))))
        for name, spline, iso, radius in (
            ("ball of distances", Spline(signed_distance()), 0.0, DISTANCE_RADIUS),
            ("ball of 8 bits", Spline(eight_bit_ball(), smoothing=1.0), 127.5, RIM_RADIUS),
        )
    ]
    return balls + [
        Case("teapot", Spline(t.volume, smoothing=1.0), t.iso, t.camera, t.backdrop, None, FINENESS_OF_LARGE)
        for t in subjects()[1:]
    ]


def masked(compared: np.ndarray, ends: Floats) -> tuple[np.ndarray, Floats, float]:
    """For ``np.where``: NaN for rays within 5 % of the rim, where renderers part on whether they arrive."""
    return compared[:, None], ends, math.nan


def labels(case: Case, fineness: int) -> list[str]:
    """Of the rows of a triangulation."""
    quantities = ["time"] if case.truth is None else ["error", "time"]
    return [f"{case.name}, mesh at {fineness}x sampling, {quantity} over direct" for quantity in quantities]


def compared(case: Case, peers: Mapping[str, Any], repeats: int) -> tuple[list[Panel], list[Row]]:
    """Pictures and rows of one volume; frames in turn, so that the machine's load meets all alike."""
    scene = Scene.build(case.spline, Layers((case.iso,), (1.0, INDEX)), bound="bernstein")

    def direct() -> Frame:
        picture = render(scene, case.camera, case.backdrop, SETTINGS)
        ends = np.where(picture.fate[..., None] == REFRACTED, picture.position_m, np.nan)
        return Frame(picture.image, ends.reshape(-1, 2))

    frames: dict[str, Callable[[], Frame]] = {"direct": direct}
    built = {}
    for k in case.fineness:
        started = time.process_time()
        mesh = triangulated(case, k, peers["scikit-image"])
        built[f"{k}"] = f"{len(mesh.surface.order)} triangles, made in {time.process_time() - started:.2g} s"
        embree = Embree(peers["Embree"], mesh.surface)
        frames[f"{k}"] = lambda mesh=mesh: meshed(case, mesh)
        frames[f"{k} by Embree"] = lambda mesh=mesh, embree=embree: meshed(case, mesh, embree.follow)
    results = {name: frame() for name, frame in frames.items()}
    seconds = alternate(frames, repeats, time.process_time)
    truth = results["direct"].ends if case.truth is None else case.truth
    off = {name: np.linalg.norm(result.ends - truth, axis=1) for name, result in results.items()}
    used = np.isfinite(truth).all(axis=1)
    error = {name: float(np.nanmedian(values[used])) for name, values in off.items()}
    panels = [Panel(f"direct rays, {1e3 * seconds['direct']:.0f} ms", results["direct"].image)]
    made = []
    for k in built:
        embree = f"{k} by Embree"
        # The better intersector is the peer.
        least = min(seconds[k], seconds[embree])
        panels.append(Panel(f"mesh at {k}x sampling, {1e3 * least:.0f} ms", results[k].image))
        lost = float((~(off[k][used] <= 1.0)).mean())
        detail = (
            f"{built[k]}; median distance of rays on the backdrop, nodes: mesh {error[k]:.2g} (by Embree "
            f"{error[embree]:.2g}), direct {error['direct']:.2g}; {lost:.2%} of the mesh's are more than 1 "
            f"off or lost; ms of processor time a frame of {PIXELS}² rays: mesh by Embree "
            f"{1e3 * seconds[embree]:.1f}, by our intersector {1e3 * seconds[k]:.1f}, direct "
            f"{1e3 * seconds['direct']:.1f}"
        )
        ratios = [least / seconds["direct"]]
        if case.truth is not None:
            ratios.insert(0, error[k] / error["direct"])
        made += [
            Row(label, ratio, 1.0, ">=", "", detail)
            for label, ratio in zip(labels(case, int(k)), ratios, strict=True)
        ]
    return panels, made


def triangulated(case: Case, fineness: int, marching_cubes: Callable[..., Any]) -> Triangulation:
    """Marching cubes of the filtered volume, sampled so often per node."""
    spline = case.spline
    axes = [np.linspace(0.0, n - 1.0, (n - 1) * fineness + 1) for n in spline.shape]
    plane = np.stack(np.meshgrid(*axes[1:], indexing="ij"), axis=-1).reshape(-1, 2)
    field = np.stack([spline.value(np.insert(plane, 0, x, axis=1)).astype(np.float32) for x in axes[0]])
    shape = [len(axis) for axis in axes]
    vertices, faces, *_ = marching_cubes(field.reshape(shape), case.iso, allow_degenerate=False)
    vertices = vertices.astype(float) / fineness
    mesh = TriangleMesh(vertices, faces.astype(np.int32))
    surface = surface_of(Chart(mesh.in_unit_cube(), np.zeros((len(faces), 3, 2))))
    # The gradients of the filtered volume at the vertices, which are better than means of faces.
    slope = spline.gradient(vertices)
    normals = (slope / np.linalg.norm(slope, axis=1, keepdims=True))[faces[surface.order]]
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    edge = float((high - low).max())
    # The middle of the volume is the origin of the scene.
    corner = 0.5 * (low + high - edge) - 0.5 * (np.array(spline.shape) - 1.0)
    return Triangulation(surface._replace(normals=normals.astype(np.float32)), corner, edge)


def meshed(case: Case, mesh: Triangulation, followed: Callable[..., None] | None = None) -> Frame:
    """The frame through a triangulation, by our intersector or another."""
    middle = (np.arange(PIXELS) + 0.5) / PIXELS - 0.5
    u, v = (np.ravel(values) for values in np.meshgrid(middle, middle))
    pencil = np.stack([np.ones_like(u), u, v], axis=1)
    start, ahead = pencil @ case.camera.origin, pencil @ case.camera.direction
    ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
    lost = np.empty(len(u), dtype=bool)
    (followed or follow)(mesh.surface, mesh.corner, mesh.edge, SETTINGS.depth, start, ahead, lost)
    plane, where = np.empty(len(u), dtype=np.int8), np.empty((len(u), 2))
    locate(case.backdrop, start, ahead, plane, where)
    plane[lost], where[lost] = -1, np.nan
    image = np.empty((PIXELS, PIXELS, 3), dtype=np.uint8)
    shape = PIXELS, PIXELS
    fate, crossed = np.zeros(shape, dtype=np.uint8), np.zeros(shape, dtype=np.int16)
    hits = Hits(plane.reshape(shape), where.reshape(*shape, 2), fate, crossed, np.ones(shape))
    point_colours(case.backdrop, hits, image)
    return Frame(image, where * case.backdrop.edges[plane])


@numba.njit(nogil=True, inline="always")
def bent(normals: Any, u: float, v: float, direction: Any, within: bool) -> tuple[Any, bool]:
    """The direction behind a face, from the weights of its corners 0 and 1, and whether that is in glass."""
    normal = u * normals[0] + v * normals[1] + (1.0 - u - v) * normals[2]
    normal /= math.sqrt((normal**2).sum())
    ratio = INDEX if within else 1.0 / INDEX
    ahead, _, passed = refracted(direction, (normal[0], normal[1], normal[2]), ratio)
    return ahead, within != passed


@numba.njit(nogil=True)
def follow(
    surface: Surface, corner: Floats, edge: float, depth: int, start: Floats, ahead: Floats, lost: Any
) -> None:
    """Follow rays through glass in air, with interpolated normals, by our intersector.

    Args:
        surface, corner, edge: as ``Triangulation``.
        depth: most surfaces on a ray.
        start, ahead: (n, 3) points and unit directions; on return those behind the glass.
        lost: (n,), filled: rays that did not leave it.
    """
    waiting = np.empty(WAITING, dtype=np.int32)
    for n in range(len(start)):
        x, y, z = (start[n] - corner) / edge
        d = (ahead[n, 0], ahead[n, 1], ahead[n, 2])
        face, within, lost[n] = -1, False, True
        for _ in range(depth + 1):
            face, s, u, v, _ = closest(surface, waiting, 0, (x, y, z), d, AHEAD, np.inf, face)
            if face < 0:
                lost[n] = within
                break
            x, y, z = x + s * d[0], y + s * d[1], z + s * d[2]
            d, within = bent(surface.normals[face], u, v, d, within)
        for axis, value in enumerate((x, y, z)):
            start[n, axis] = corner[axis] + edge * value
            ahead[n, axis] = d[axis]


class Embree:
    """The same by Embree: all rays to their next face, then all bent there."""

    def __init__(self, module: Any, surface: Surface) -> None:
        from embreex.mesh_construction import TriangleMesh as Faces

        corners = np.ascontiguousarray(surface.triangles[:, :9]).reshape(-1, 3)
        self.scene = module.EmbreeScene()
        Faces(self.scene, corners, np.arange(len(corners), dtype=np.int32).reshape(-1, 3))

    def follow(
        self,
        surface: Surface,
        corner: Floats,
        edge: float,
        depth: int,
        start: Floats,
        ahead: Floats,
        lost: Any,
    ) -> None:
        """As ``follow``."""
        start -= corner
        start /= edge
        within, active = np.zeros(len(start), dtype=bool), np.arange(len(start))
        lost[:] = True
        for _ in range(depth + 1):
            origins = (start[active] + AHEAD * ahead[active]).astype(np.float32)
            hits = self.scene.run(origins, ahead[active].astype(np.float32), query="INTERSECT", output=True)
            met = hits["primID"] >= 0
            lost[active[~met]] = within[active[~met]]
            active = active[met]
            if not len(active):
                break
            found = (hits[name][met] for name in ("primID", "tfar", "u", "v"))
            bend(surface.normals, active, *found, start, ahead, within)
        start *= edge
        start += corner


@numba.njit(nogil=True)
def bend(
    normals: Any, rays: Any, faces: Any, s: Any, u: Any, v: Any, start: Floats, ahead: Floats, within: Any
) -> None:
    """Move rays to the faces that they meet, and bend them; u and v are weights of the corners 1 and 2."""
    for k, n in enumerate(rays):
        d = (ahead[n, 0], ahead[n, 1], ahead[n, 2])
        start[n] += (s[k] + AHEAD) * ahead[n]
        d, within[n] = bent(normals[faces[k]], 1.0 - u[k] - v[k], float(u[k]), d, within[n])
        ahead[n, 0], ahead[n, 1], ahead[n, 2] = d
