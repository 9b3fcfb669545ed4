"""Goals G1 to G4 and G6: geometry fields against the fastest exact intersectors."""

import time
from collections.abc import Iterable

import numpy as np

from bentray_kernels.geometry_field.image.geometry_image import GeometryImage, geometry_image
from bentray_kernels.geometry_field.layout.parameterisation import parameterise
from bentray_kernels.meshes.example_surfaces import bumpy_ball
from bentray_kernels.meshes.mesh import Chart
from bentray_kernels.meshes.surface import surface_of
from bentray_service.cli.output.benchmark_context import BenchmarkContext
from bentray_service.cli.output.benchmark_row import Row

from ..shared._available import available
from ..shared._timing import alternate
from ._field_lookups import PIXELS, SAMPLES, Lookups, between_pixels
from ._field_rays import build_outer_field, camera_rays, incoherent_rays, load_mesh
from ._geometry_frames import rows as frame_rows
from ._intersectors import PEERS, Ours

REPEATS = 9

# Faces of the bumpy balls for G6, and rays: few, so that many runs find one that nothing disturbs.
BALLS, BALL_RAYS = (5_000, 20_000, 100_000), 200_000


def rows(context: BenchmarkContext) -> Iterable[Row]:
    """G1, G2, G3, G4 and G6, and frames a second."""
    context.progress(0, 6, "laying the mesh out")
    name, mesh = load_mesh()
    chart = parameterise(mesh).chart
    context.progress(1, 6, "building the field")
    surface = surface_of(chart)
    build_outer_field(surface, 4)
    seconds = []
    for _ in range(1 if context.quick else 3):
        start = time.perf_counter()
        build_outer_field(surface_of(chart), SAMPLES)
        seconds.append(time.perf_counter() - start)
    detail = f"{name}, n = {SAMPLES}, two threads, hierarchy included; theirs 420 to 672 s"
    yield Row("G1 outer field", min(seconds), 10.0, "<=", "s", detail)
    lookups = Lookups.from_chart(chart, SAMPLES)
    context.progress(2, 6, "comparing with exact intersectors")
    peers, missing = available({peer: (module, adapt) for peer, (module, adapt) in PEERS.items()})
    exact = {peer: adapter(mesh) for peer, adapter in peers.items()} | {"ours": Ours(lookups.surface)}
    reasons = "; ".join(missing.values())
    yield from incoherent_rows(lookups, exact, reasons, 200_000 if context.quick else 1_000_000)
    context.progress(3, 6, "rays of a camera")
    yield from coherent_rows(lookups, exact, reasons, 256 if context.quick else 1024)
    context.progress(4, 6, "the published lookups")
    yield from published_rows(lookups, geometry_image(chart, PIXELS), 200_000)
    context.progress(5, 6, "more and fewer faces")
    yield from face_rows(8 if context.quick else SAMPLES)
    yield from frame_rows(context.quick)
    context.progress(6, 6, "done")


def timed(lookups: Lookups, exact: dict, rays: tuple[np.ndarray, np.ndarray]) -> dict[str, float]:
    """ns a ray of every lookup and every exact intersector, in turn, one thread."""
    runs = lookups.runs(rays)[0] | {peer: engine.run(*rays) for peer, engine in exact.items()}
    return {name: 1e9 * least / len(rays[0]) for name, least in alternate(runs, REPEATS).items()}


def ratio_row(label: str, goal: float, ns: dict, ours: str, exact: dict, missing: str) -> Row:
    """How much faster than the fastest exact intersector that is not ours."""
    peers = {peer: ns[peer] for peer in exact if peer != "ours"}
    if not peers:
        return Row(label, None, goal, ">=", "", missing)
    listed = ", ".join(f"{name} {least:.1f}" for name, least in ns.items())
    detail = f"ns a ray, one thread: {listed}" + (f"; {missing}" if missing else "")
    return Row(label, min(peers.values()) / ns[ours], goal, ">=", "", detail)


def incoherent_rows(lookups: Lookups, exact: dict, missing: str, count: int) -> Iterable[Row]:
    """G2."""
    rays = incoherent_rays(count)
    ns = timed(lookups, exact, rays)
    yield ratio_row("G2 nearest entry and plane, speed", 2.0, ns, "plane", exact, missing)
    yield ratio_row("G2 nearest entry and walk, speed", 1.0, ns, "walk", exact, missing)
    runs, results = lookups.runs(rays)
    for way, goal in (("plane", 1e-3), ("walk", 1e-6)):
        runs[way]()
        errors, wrong = against_exact(lookups, rays, results[way])
        detail = (
            f"edges of the cube; mean {errors.mean():.2g}, 90 % within {np.quantile(errors, 0.9):.2g}, "
            f"99 % within {np.quantile(errors, 0.99):.2g}"
        )
        yield Row(f"G2 {way}, median error", float(np.median(errors)), goal, "<=", "", detail)
        detail = f"{count} rays from face to face of the cube, n = {lookups.field.samples}"
        yield Row(f"G2 {way}, wrong hit or miss", 100.0 * wrong, 2.1, "<=", "%", detail)


def against_exact(lookups: Lookups, rays: tuple, distances: np.ndarray) -> tuple[np.ndarray, float]:
    """Distances between the points found and the exact ones, and the share of rays whose hit is wrong."""
    faces, exact = Ours(lookups.surface).first(*rays)
    met = np.isfinite(distances)
    both = met & (faces >= 0)
    length = np.linalg.norm(rays[1][both].astype(float), axis=1)
    return np.abs(distances[both] - exact[both]) * length, float((met != (faces >= 0)).mean())


def coherent_rows(lookups: Lookups, exact: dict, missing: str, pixels: int) -> Iterable[Row]:
    """G3."""
    ns = timed(lookups, exact, camera_rays(pixels))
    yield ratio_row("G3 nearest (u, v), speed", 15.0, ns, "nearest uv", exact, missing)
    yield ratio_row("G3 4-D linear place, speed", 3.5, ns, "linear place", exact, missing)
    yield ratio_row("G3 4-D linear (u, v), speed", 3.5, ns, "linear uv", exact, missing)
    yield ratio_row("G3 nearest entry and plane, speed", 3.5, ns, "plane", exact, missing)


def published_rows(lookups: Lookups, image: GeometryImage, count: int) -> Iterable[Row]:
    """G4: where the geometry image puts the published (u, v), beside our places on the rays."""
    rays = incoherent_rays(count)
    faces, exact = Ours(lookups.surface).first(*rays)
    runs, results = lookups.runs(rays)
    errors = {}
    for way, run in runs.items():
        run()
        points = rays[0] + results[way][:, None] * rays[1] if results[way].ndim == 1 else None
        if points is None:
            points = between_pixels(image, image.positions, results[way])
        ends = rays[0] + np.where(faces >= 0, exact, np.nan)[:, None] * rays[1]
        off = np.linalg.norm(points - ends, axis=1)
        errors[way] = off[np.isfinite(off)]
    for way, off in errors.items():
        far = 100.0 * float((off > 0.1).mean())
        detail = f"edges of the cube; mean {off.mean():.2g}, farther than 0.1: {far:.2f} %"
        goal = 0.02 if way.endswith("uv") else 2e-3
        yield Row(f"G4 {way}, median error", float(np.median(off)), goal, "<=", "", detail)
    torn = float((errors["linear uv"] > 0.1).mean() / (errors["linear place"] > 0.1).mean())
    detail = (
        "rays put farther than 0.1 from their place: averages of (u, v) over averages of places that agree"
    )
    yield Row("G4 what not averaging across seams saves", torn, 2.0, ">=", "", detail)


def face_rows(n: int) -> Iterable[Row]:
    """G6."""
    rays = incoherent_rays(BALL_RAYS)
    runs: dict = {}
    for faces in BALLS:
        mesh = bumpy_ball(faces).in_unit_cube()
        lookups = Lookups.from_chart(Chart(mesh, mesh.corners[..., :2]), n)
        ours = lookups.runs(rays)[0]
        runs |= {(way, faces): ours[way] for way in ("plane", "nearest uv", "walk")}
        runs["exact", faces] = Ours(lookups.surface).run(*rays)
    ns = {key: 1e9 / BALL_RAYS * least for key, least in alternate(runs, 3 * REPEATS).items()}
    for way in ("plane", "nearest uv", "walk"):
        costs = [ns[way, faces] for faces in BALLS]
        listed = "; ".join(
            f"{name} " + ", ".join(f"{ns[name, faces]:.1f}" for faces in BALLS)
            for name in dict.fromkeys((way, "walk", "exact"))
        )
        detail = f"ns a ray of 5, 20 and 100 thousand faces: {listed} (ours)"
        growth = 100.0 * (max(costs) / min(costs) - 1.0)
        yield Row(f"G6 {way}, 5k to 100k faces", growth, 10.0, "<=", "%", detail)
