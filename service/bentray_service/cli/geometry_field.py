"""`bentray geometry-field`: build and render the geometry field of a mesh without a server."""

from __future__ import annotations

import shutil
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from .options.option_tables import with_options
from .options.paths import input_file, output_folder
from .options.view_options import FIELD_SETTINGS, FIELD_VIEW, field_of
from .output.terminal import AsJson, Step, print_json, print_lines, print_table, progress_bar, progress_shown
from .render import tiles_in_threads

if TYPE_CHECKING:
    from bentray_workers.files.mesh_formats import ReadMesh
    from bentray_workers.rendering.field_view import FieldView

ACCEPTED = "a triangle mesh: PLY, OBJ, OFF, STL, glTF or GLB"


@with_options({**FIELD_SETTINGS, **FIELD_VIEW})
def geometry_field(
    mesh: Annotated[Path, typer.Argument(help="Triangle mesh: PLY, OBJ, OFF, STL, glTF or GLB.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="Output folder; created if missing.")],
    options: dict[str, Any],
    as_json: AsJson = False,
) -> None:
    """Build the geometry field of a mesh and render it into OUTPUT.

    Writes image.png, geometry-image.png, normal-map.png, geometry-field.json and the field. An existing field
    is reused; an interrupted one is continued.

    Example:  bentray geometry-field bunny.ply -o bunny --mode refract
    """
    source, folder = input_file(mesh, ACCEPTED), output_folder(output)
    settings, view = field_of(options)
    view.check_samples(settings.samples)

    with progress_bar("Building the field") as step:
        from bentray_service.rows.ids import field_of as field_name
        from bentray_workers.files.atomic import write_json
        from bentray_workers.files.mesh import StoredMesh, summary_of, write_mesh
        from bentray_workers.files.mesh_formats import read_mesh
        from bentray_workers.rendering.field_settings import check_faces
        from bentray_workers.rendering.geometry_field import build_field

        read: ReadMesh = read_mesh(source.read_bytes())
        check_faces(len(read.surface.mesh.faces))
        stored = StoredMesh(read.surface.mesh, read.colours)
        summary = summary_of(stored, read.surface, read.format)
        name = field_name(settings.content(summary["content"]))
        target, work = folder / name, folder / f"{name}-unfinished"
        work.mkdir(exist_ok=True)
        write_mesh(work / "mesh.h5", stored)
        started = time.perf_counter()
        shown = progress_shown(step)
        figures = build_field(None, work / "mesh.h5", settings, target, work, on_progress=shown)
    shutil.rmtree(work)
    made = time.perf_counter()
    with progress_bar("Drawing") as step:
        outputs = _draw(target, view, folder, step)
    seconds = {"make_seconds": made - started, "draw_seconds": time.perf_counter() - made}
    record = {"mesh": str(source), **summary, **settings.plain(), "figures": figures, **seconds}
    record |= {"view": view.plain(), "outputs": {"field": str(target), **outputs}}
    write_json(folder / "geometry-field.json", record)
    _show(source, record, as_json=as_json)


def _draw(field: Path, view: FieldView, folder: Path, step: Step) -> dict[str, str]:
    """Render the three images; returns their paths by name."""
    from bentray_workers.files.atomic import write_bytes
    from bentray_workers.rendering.field_picture import map_png, tile_image
    from bentray_workers.rendering.tiles import stack_png

    rows = max(1, 2**16 // (view.width * view.rays**2))
    strips = tiles_in_threads(partial(tile_image, field, view), view.height, rows, step)
    draw: dict[str, Callable[[], bytes]] = {
        "image": lambda: stack_png(strips),
        "geometry-image": lambda: map_png(field, "positions"),
        "normal-map": lambda: map_png(field, "normals"),
    }
    for name, png in draw.items():
        write_bytes(folder / f"{name}.png", png())
    return {name.replace("-", "_"): str(folder / f"{name}.png") for name in draw}


def _show(source: Path, record: dict[str, Any], *, as_json: bool) -> None:
    if as_json:
        print_json(record)
        return
    figures = record["figures"]
    mended = ", ".join(f"{n} {what.replace('_', ' ')}" for what, n in record["repairs"].items() if n)
    kind = "closed" if record["holes"] == 0 else f"{record['holes']} holes"
    tables = (figures["outer_bytes"] + figures["inner_bytes"]) / 1e6
    rows = [
        ("mesh", f"{record['faces']} faces, {kind}, genus {record['genus']}"),
        ("mended", mended or "nothing"),
        ("geometry image", f"{figures['image_pixels']}², rms error {figures['image_rms']:.1e} of the cube"),
        ("tables", f"{record['samples']} samples along an edge, {tables:.0f} MB"),
        ("wrong hits and misses", f"{100.0 * figures['lookup_wrong']:.2f} % of random rays"),
        ("error of the others", f"{figures['lookup_median']:.1e} of the cube, median"),
        ("time", f"{record['make_seconds']:.1f} s to build, {record['draw_seconds']:.1f} s to render"),
    ]
    print_table(f"Geometry field of {source.name}", ("figure", "value"), rows)
    print_lines(record["outputs"].values())
