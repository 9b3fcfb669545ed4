"""`bentray render`: refractive rendering of a volume without a server."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeVar

import typer

from bentray_kernels.errors import InvalidInput

from .options.option_tables import with_options
from .options.paths import check_apart, input_file, output_file
from .options.view_options import VIEW, view_of
from .output.terminal import AsJson, print_json, print_lines, print_table, progress_bar

if TYPE_CHECKING:
    from bentray_kernels.refraction import Scene
    from bentray_workers.files.volume import Volume
    from bentray_workers.images.png import Colours
    from bentray_workers.rendering.refraction import Tile
    from bentray_workers.rendering.refraction_view import RefractionView

ACCEPTED = "a volume: NumPy, NRRD, NIfTI, HDF5 of Bentray, or raw with --shape and --dtype"
# Size of the tile of a thread: rows, fewer with many rays, since Ctrl-C waits for tiles in progress.
ROWS, RAYS = 32, 2**15
# Side of the cube of a phantom.
PHANTOM_SIDE_M = 0.1

T = TypeVar("T")
SampledPhantom = Literal["sphere", "one-hole", "two-holes", "marschner-lobb"]


@with_options(VIEW)
def render(
    output: Annotated[Path, typer.Option("--output", "-o", help="Image file to write (PNG).")],
    options: dict[str, Any],
    file: Annotated[
        Path | None, typer.Argument(help="Volume file; the format is detected from its content.")
    ] = None,
    phantom: Annotated[
        SampledPhantom | None, typer.Option(help="Phantom to render instead of a file.")
    ] = None,
    nodes: Annotated[int, typer.Option(min=8, max=512, help="Nodes per side of the phantom.")] = 64,
    position_map: Annotated[
        Path | None,
        typer.Option("--map", help="Also write the backdrop coordinates seen by each pixel (NumPy, m)."),
    ] = None,
    shape: Annotated[
        tuple[int, int, int] | None, typer.Option(help="Shape of a raw file, x fastest.", metavar="NX NY NZ")
    ] = None,
    dtype: Annotated[
        str | None, typer.Option(help="Data type of a raw file, e.g. uint8, int16-be, float32.")
    ] = None,
    spacing: Annotated[
        list[float] | None,
        typer.Option(
            help="Node spacing of raw and NumPy files, m: one value, or one per axis.",
            show_default="0.001",
            metavar="DX [DY DZ]",
        ),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace files that exist.")] = False,
    as_json: AsJson = False,
) -> None:
    """Render a volume as refracting glass, or its surface, into OUTPUT.

    Example:  bentray render -o glass.png --phantom two-holes --index 1.5 --backdrop picture
    """
    from bentray_kernels.opencl import check_available

    if (file is None) == (phantom is None):
        shown = "neither a file nor --phantom" if file is None else "a file and --phantom"
        raise InvalidInput("file", shown, "one of the two")
    if phantom is not None:
        _refuse({"--shape": shape, "--dtype": dtype, "--spacing": spacing})
    view, picture = view_of(options)
    check_available(view.device)
    outputs = {"--output": output, "--map": position_map}
    check_apart(outputs, {"the volume": file, "the backdrop": picture})
    png = output_file(output, force=force, suffix=".png")
    placed = None if position_map is None else output_file(position_map, force=force, suffix=".npy")
    if placed is not None and view.mode == "shaded":
        raise InvalidInput("--map", placed, "no --map with --mode shaded, which has no backdrop")

    from bentray_workers.files.atomic import write_bytes
    from bentray_workers.files.geometry_field_folder import write_array
    from bentray_workers.files.volume_formats import VolumeMetadata, import_volume
    from bentray_workers.images.png import png_of, read_picture
    from bentray_workers.rendering.drawing_device import devices_of
    from bentray_workers.rendering.scene_cache import build_scene, check_size, filter_volume

    card = None if picture is None else read_picture(picture)
    if file is None:
        assert phantom is not None
        volume = _sampled(phantom, nodes)
    else:
        given = VolumeMetadata(spacing_m=tuple(spacing) if spacing else None, shape=shape, dtype=dtype)
        volume = import_volume(input_file(file, ACCEPTED), given, check_size)
    started = time.perf_counter()
    view = view.within(*volume.range())
    filtered = filter_volume(volume, view)
    view = replace(view.filtered_within(*filtered.range), smoothing=view.smoothing_for(volume.values.dtype))
    scene = build_scene(filtered, view.layers())
    built = time.perf_counter()
    with progress_bar("Rendering") as step:
        strips = _drawn(scene, view, card, step)
    seconds = time.perf_counter() - built
    image, position = _joined(strips)
    device = devices_of([strip.drawn for strip in strips])
    write_bytes(png, png_of(image, device))
    if placed is not None:
        write_array(placed, position)
    _show(volume, view, png, placed, device, (built - started, seconds), as_json=as_json)


def _refuse(given: dict[str, object]) -> None:
    for option, value in given.items():
        if value:
            raise InvalidInput(option, value, "no such option with --phantom")


def _sampled(phantom: SampledPhantom, nodes: int) -> Volume:
    from bentray_kernels.phantoms import (
        ONE_HOLE,
        TWO_HOLES,
        CubeField,
        FringeSphere,
        MarschnerLobb,
        sampled,
    )
    from bentray_workers.files.volume import Volume

    fields: dict[SampledPhantom, CubeField] = {
        "sphere": FringeSphere(0.6, 0.06),
        "one-hole": ONE_HOLE,
        "two-holes": TWO_HOLES,
        "marschner-lobb": MarschnerLobb(),
    }
    return Volume.from_values(
        sampled(fields[phantom], nodes), (PHANTOM_SIDE_M / (nodes - 1),) * 3, title=phantom
    )


def _drawn(
    scene: Scene, view: RefractionView, card: Colours | None, step: Callable[[int, int], None]
) -> list[Tile]:
    from bentray_kernels.opencl import computed
    from bentray_workers.rendering.drawing_device import caster_for
    from bentray_workers.rendering.refraction import draw_tile

    rows = min(ROWS, max(1, RAYS // (view.width * view.times**2)))
    rays = view.width * view.height * (view.times / view.ray_spacing) ** 2
    if view.mode == "refract" and computed(lambda: caster_for(scene, int(rays), view.device))[0] is not None:
        # A device casts all rays together.
        rows = view.height
    return tiles_in_threads(
        lambda first, last: draw_tile(scene, view, first, last, card), view.height, rows, step
    )


def tiles_in_threads(
    draw: Callable[[int, int], T], height: int, rows: int, step: Callable[[int, int], None]
) -> list[T]:
    """Tiles of a picture from top to bottom, one thread per core; ``draw`` draws rows from first to last."""
    pool, tiles = ThreadPoolExecutor(len(os.sched_getaffinity(0))), []
    try:
        drawn = [pool.submit(draw, first, min(first + rows, height)) for first in range(0, height, rows)]
        for future in drawn:
            tiles.append(future.result())
            step(len(tiles), len(drawn))
    finally:
        # After Ctrl-C no further tiles are started.
        pool.shutdown(cancel_futures=True)
    return tiles


def _joined(strips: list[Tile]) -> tuple[Colours, Any]:
    """The image, and the backdrop position of each pixel; None for a shaded image."""
    import numpy as np

    positions = [strip.position_m for strip in strips if strip.position_m is not None]
    image = np.concatenate([strip.image for strip in strips])
    return image, np.concatenate(positions) if positions else None


def _show(
    volume: Volume,
    view: RefractionView,
    png: Path,
    placed: Path | None,
    device: str,
    seconds: tuple[float, float],
    *,
    as_json: bool,
) -> None:
    rays = view.width * view.height * view.times**2
    outputs = [str(path) for path in (png, placed) if path is not None]
    if as_json:
        record = {
            "output": str(png),
            "map": None if placed is None else str(placed),
            "shape": list(volume.values.shape),
            "range": list(volume.range()),
            "rays": rays,
            "device": device,
            "build_seconds": round(seconds[0], 4),
            "render_seconds": round(seconds[1], 4),
            "view": view.plain(),
        }
        print_json(record)
        return
    low, high = volume.range()
    surfaces = ", ".join(f"{iso:g} (index {n:g})" for iso, n in zip(view.iso, view.indices, strict=True))
    rows = [
        ("volume", f"{' by '.join(map(str, volume.values.shape))} nodes, {low:g} to {high:g}"),
        ("surfaces", surfaces),
        ("filter", view.filter),
        ("drawn by", device),
        ("time", f"{seconds[0]:.2f} s to build, {seconds[1]:.2f} s for {rays} rays"),
    ]
    print_table(volume.title or "Volume", ("figure", "value"), rows)
    print_lines(outputs)
