"""Turntables: refractive renderings of a volume from all sides, in one file."""

import zipfile
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, Literal, Unpack

from distributed import Client
from PIL import Image

from bentray_kernels.errors import InvalidInput
from bentray_kernels.requests.ranges import Range
from bentray_kernels.requests.request_fields import setting
from bentray_kernels.task_graph import Task

from ..cluster.capacities import capacities_by_address
from ..cluster.resources import DRAWING
from ..cluster.task_pool import JobControl, Placement, run_job
from ..files.atomic import atomic_replace, write_bytes
from ..images.png import device_of, stated
from .drawing_device import Drawn
from .picture_cost import placed, refraction_bytes
from .refraction import tile_image
from .refraction_view import RefractionView
from .scene_cache import stored_shape
from .tiles import stack_png, tile_rows

FORMATS = ("zip", "apng")
MAX_FRAMES = 720
# Of all frames; writing an APNG holds most of them in memory.
MAX_PIXELS = 2**27
# Of an uncompressed pixel, and of the headers of a picture and of its entry in an archive.
PIXEL_BYTES, PICTURE_BYTES = 4, 4096

FRAME_MS = 80
# Zip files store a date; a fixed one gives the same file for the same frames.
DATE = (1980, 1, 1, 0, 0, 0)


@dataclass(frozen=True)
class Turntable(RefractionView):
    """A camera path around a volume.

    Raises:
        InvalidInput: naming the first field that is wrong.
    """

    frames: int = setting(36, "Number of frames.", Range(1, MAX_FRAMES), label="Frames per turn")
    turn_deg: float = setting(
        360.0,
        "Rotation of the camera, degrees; the last frame is one step before the end.",
        Range(-3600.0, 3600.0),
    )
    format: Literal["zip", "apng"] = setting("zip", "zip: one PNG per frame; apng: an animated PNG.")

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.format not in FORMATS:
            raise InvalidInput("format", repr(self.format), "one of " + ", ".join(FORMATS))
        pixels = self.frames * self.width * self.height
        if pixels > MAX_PIXELS:
            raise InvalidInput(
                "frames", f"{self.frames}, {pixels} pixels in total", f"at most {MAX_PIXELS} pixels"
            )

    @property
    def largest_bytes(self) -> int:
        """Bytes of its pictures and the file made of them, without compression."""
        return 2 * (self.frames * (PIXEL_BYTES * self.width + 1) * self.height + PICTURE_BYTES * self.frames)

    def frame(self, number: int) -> RefractionView:
        """The view of one frame, from 0."""
        view: dict[str, Any] = {field.name: getattr(self, field.name) for field in fields(RefractionView)}
        view["azimuth_deg"] = (self.azimuth_deg + self.turn_deg * number / self.frames) % 360.0
        return RefractionView(**view)


class TurntableGraph:
    """Task graph of a turntable: tiles of each frame, the frame as PNG, then the file of all frames.

    Args:
        path: of a volume or reconstruction file, readable by every worker.
        turntable: what to draw.
        target: the file to write, whole or not at all.
        folder: for the frames, which every worker can read and write; existing frames are not drawn again.
    """

    def __init__(self, path: Path, turntable: Turntable, target: Path, folder: Path) -> None:
        self._path, self._turntable, self._target = path, turntable, target
        self._frames = [folder / f"{number:04d}.png" for number in range(turntable.frames)]
        self._missing = [number for number, frame in enumerate(self._frames) if not frame.exists()]
        self._tiles: dict[int, dict[int, Any]] = defaultdict(dict)
        self.total = turntable.frames
        self.done = self.total - len(self._missing)

    def first(self) -> list[Task]:
        return [
            Task(draw_frame_tile, (self._path, self._turntable, number, *rows), keep_on_worker=True)
            for number in self._missing
            for rows in tile_rows(self._turntable)
        ] or [self._pack()]

    def after(self, task: Task, result: Any) -> list[Task]:
        if task.function is draw_frame_tile:
            _, _, number, first, _ = task.arguments
            tiles = self._tiles[number]
            tiles[first] = result
            if len(tiles) < len(tile_rows(self._turntable)):
                return []
            stacked = [tile for _, tile in sorted(self._tiles.pop(number).items())]
            return [Task(write_frame, (self._frames[number], stacked))]
        if task.function is not write_frame:
            return []
        self.done += 1
        return [self._pack()] if self.done == self.total else []

    def _pack(self) -> Task:
        pack = {"zip": write_zip, "apng": write_apng}[self._turntable.format]
        return Task(pack, (self._frames, self._target))


def draw_turntable(
    client: Client | None,
    path: Path,
    turntable: Turntable,
    target: Path,
    work_dir: Path,
    **control: Unpack[JobControl],
) -> None:
    """Draw all frames and write them to one file.

    Args:
        client: of a cluster; None: the cores of this process.
        path: of a volume or reconstruction file, readable by every worker.
        turntable: what to draw.
        target: the file to write, by a worker, whole or not at all.
        work_dir: a folder for the frames, which every worker can read and write; frames of an unfinished run
            of the same turntable are not drawn again.
        control: see ``JobControl``.

    Raises:
        Cancelled: when ``stop`` returned true.
        InvalidInput: from the file or the view.
    """
    size = refraction_bytes(stored_shape(path), turntable)

    def placement() -> Placement:
        return placed(size, capacities_by_address(client), DRAWING)

    graph = TurntableGraph(path, turntable, target, work_dir)
    run_job(client, graph, work_dir, lane="drawing", placement=placement, **control)


def draw_frame_tile(path: Path, turntable: Turntable, number: int, first: int, last: int) -> Drawn:
    """Task: the rows ``first`` to ``last`` of a frame, the last one not included."""
    return tile_image(path, turntable.frame(number), first, last)


def write_frame(frame: Path, tiles: Sequence[Drawn]) -> None:
    """Task: tiles, stacked from top to bottom, as PNG file."""
    write_bytes(frame, stack_png(tiles))


def write_zip(frames: Sequence[Path], target: Path) -> None:
    """Task: pictures in a zip file; PNG is compressed already."""
    with atomic_replace(target) as partial, zipfile.ZipFile(partial, "w", zipfile.ZIP_STORED) as archive:
        for frame in frames:
            archive.writestr(zipfile.ZipInfo(frame.name, DATE), frame.read_bytes())


def write_apng(frames: Sequence[Path], target: Path) -> None:
    """Task: pictures in an animated PNG that repeats."""
    device = stated("; ".join(sorted({device_of(frame) for frame in frames} - {""})))
    with atomic_replace(target) as partial, Image.open(frames[0]) as first:
        later = _Opened(frames[1:])
        how = {"save_all": True, "append_images": later, "duration": FRAME_MS, "loop": 0}
        first.save(partial, "PNG", pnginfo=device, **how)


class _Opened:
    """Pictures opened one after the other, each time they are iterated over; Pillow does so twice."""

    def __init__(self, paths: Sequence[Path]) -> None:
        self._paths = paths

    def __iter__(self) -> Iterator[Image.Image]:
        for path in self._paths:
            with Image.open(path) as picture:
                yield picture
