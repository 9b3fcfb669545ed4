"""Conformal parameterisation: a surface is cut to a disk and flattened onto the unit square."""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import chain

import numpy as np

from ...arrays import Flags, Floats
from ...errors import InvalidInput
from ...meshes.mesh import Chart, TriangleMesh
from ...meshes.opening import cut_open
from ...meshes.topology import Topology, topology_of
from .conformal import Disk
from .cutting import Cutter
from .distortion import area_stretch, crosses_itself, quasi_conformal_factors, signed_areas
from .embedding import round_embedding, unfolded
from .framing import in_unit_square

# The first layout comes once nothing shrinks by more than e^3; then each has twice as many ends of the cut as
# the one before, up to so many, and is taken if it does not overlap and stretches by so much less.
SHRUNK = 3.0
MAX_ENDS = 64
ENOUGH = 0.95

# Stages.
CUTTING, PARAMETERISING = "cutting", "parameterising"

# Between the boundary that keeps its lengths, 0, and a circle, 1.
ROUNDINGS = (0.03, 0.1, 0.25, 0.5, 1.0)


@dataclass(frozen=True)
class Parameterisation:
    """A chart and its distortion.

    Attributes:
        chart: the mesh in the unit cube, and its layout.
        cut: (edges of ``topology_of(faces)``,) where the surface is open in the layout.
        conformal: whether the layout keeps angles; if not, the surface is so bad that only a layout which
            keeps nothing but the order of the triangles is free of folds.
        area_stretch: of ``layout.distortion.area_stretch``.
        quasi_conformal: (faces,) of ``layout.distortion.quasi_conformal_factors``.
    """

    chart: Chart
    cut: Flags
    conformal: bool
    area_stretch: float
    quasi_conformal: Floats


# Called with the stage, how many of its layouts are done, and the most that there may be.
OnStage = Callable[[str, int, int], None]

# Longest side of a face that counts beside the unit cube: tables keep places in float32.
MIN_SIDE = 1e-8


def parameterise(mesh: TriangleMesh, on_stage: OnStage = lambda *_: None) -> Parameterisation:
    """Cut a surface to a disk and lay it out on the unit square, conformally and without folds.

    The cut goes through all handles and boundaries, and out to where a flat layout shrinks the surface most,
    as long as that makes the layout stretch less (Gu, Gortler and Hoppe, "Geometry images", 2002). Of several
    conformal layouts that do not overlap, the one that stretches least is taken.

    Args:
        mesh: one connected oriented surface, with boundaries or handles or without.
        on_stage: called before each layout of the stages ``cutting`` and ``parameterising``.

    Raises:
        InvalidInput: for several pieces, for fans that touch in a vertex alone, for edges of three faces, for
            faces without area, for faces that are lost beside the whole, and for triangles too thin for any
            layout.
    """
    try:
        layout = _parameterised(mesh.in_unit_cube(), on_stage)
    except RuntimeError as error:
        # SuperLU says so of the matrix of angles that are all 0 or π.
        if "singular" not in str(error):
            raise
        raise _too_thin() from None
    if not (math.isfinite(layout.area_stretch) and np.isfinite(layout.quasi_conformal).all()):
        raise _too_thin()
    return layout


def _too_thin() -> InvalidInput:
    accepted = "triangles that are less thin; remesh the surface with sides of one length"
    return InvalidInput("mesh", "triangles too thin to be laid out", accepted)


def _parameterised(mesh: TriangleMesh, on_stage: OnStage) -> Parameterisation:
    topology = _checked(mesh)
    cutter = Cutter(mesh, topology)
    cut = cutter.first()
    areas = np.linalg.norm(mesh.face_normals, axis=1)
    best: tuple[Flags, Disk] | None = None
    due, least = 0, math.inf
    for number, end in enumerate(chain(cutter.far_ends(cut), [None])):
        on_stage(CUTTING, number, MAX_ENDS)
        small_enough = end is None or end.scale <= SHRUNK
        if small_enough and number >= due and _opens(topology, cut.edges):
            disk = Disk.from_mesh(mesh.vertices, cut_open(topology, cut.edges))
            plane = in_unit_square(disk.isometric_layout())
            overlaps = crosses_itself(plane[disk.boundary])
            stretch = area_stretch(areas, np.abs(signed_areas(plane[disk.faces])))
            if best is not None and (overlaps or stretch > ENOUGH * least):
                break
            best, least, due = (cut.edges, disk), stretch, max(2 * number, 2)
            if overlaps:
                break
        if end is None or number == MAX_ENDS:
            break
        cut = cutter.grown(cut, end.vertex)
    if best is None:
        raise _too_thin()
    return _laid_out(mesh, areas, *best, on_stage)


def _opens(topology: Topology, cut: Flags) -> bool:
    """Whether there is a boundary after the cut; that of a lone edge would have two vertices."""
    return bool(topology.on_boundary.any()) or int(cut.sum()) > 1


def _checked(mesh: TriangleMesh) -> Topology:
    topology = topology_of(mesh.faces)
    pieces = int(topology.pieces.max()) + 1
    if pieces > 1:
        raise InvalidInput("faces", f"{pieces} pieces", "one connected surface")
    fans = topology.fans(~topology.on_boundary)
    touching = int(fans.max()) + 1 - len(np.unique(topology.faces))
    if touching > 0:
        raise InvalidInput("faces", f"{touching} vertices where fans of faces touch", "none")
    longest = np.linalg.norm(np.roll(mesh.corners, -1, axis=1) - mesh.corners, axis=-1).max(axis=1)
    lost = int((longest < MIN_SIDE).sum())
    if lost:
        accepted = f"sides of {MIN_SIDE:g} of the whole mesh or more"
        raise InvalidInput("mesh", f"{lost} faces that are lost beside the whole", accepted)
    flat = (np.linalg.norm(mesh.face_normals, axis=1) == 0.0).sum()
    if flat:
        raise InvalidInput("faces", f"{flat} without area", "none")
    return topology


def _laid_out(
    mesh: TriangleMesh, areas: Floats, cut: Flags, disk: Disk, on_stage: OnStage
) -> Parameterisation:
    best, least, conformal = None, math.inf, True
    on_stage(PARAMETERISING, 0, 1 + len(ROUNDINGS))
    for number, plane in enumerate(_layouts(disk), 1):
        on_stage(PARAMETERISING, number, 1 + len(ROUNDINGS))
        stretch = area_stretch(areas, signed_areas(plane[disk.faces]))
        if best is not None and stretch >= least:
            break
        if math.isfinite(stretch) and not crosses_itself(plane[disk.boundary]):
            best, least = plane, stretch
    if best is None:
        best, conformal = in_unit_square(round_embedding(disk)), False
        least = area_stretch(areas, signed_areas(best[disk.faces]))
    uv = best[disk.faces]
    factors = quasi_conformal_factors(mesh.corners, uv)
    return Parameterisation(Chart(mesh, uv), cut, conformal, least, factors)


def _layouts(disk: Disk) -> Iterator[Floats]:
    """Conformal layouts in the unit square, from the one that stretches least to the roundest."""
    yield in_unit_square(unfolded(disk.isometric_layout(), disk))
    for share in ROUNDINGS:
        plane = disk.layout((1.0 - share) * disk.isometric_turning + share * disk.round_turning())
        if np.isfinite(plane).all():
            yield in_unit_square(unfolded(plane, disk))
