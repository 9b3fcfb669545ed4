"""Turntables: a volume as glass from all sides, a picture a task, packed into one file."""

from __future__ import annotations

import zipfile
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, Literal

from distributed import Client, Future
from PIL import Image

from bentray_kernels.errors import InvalidInput
from bentray_kernels.ranges import Range
from bentray_kernels.request_fields import asked
from bentray_kernels.tomography import Progress

from ..cluster.capacities import offers_by_address
from ..cluster.fair_shares import Share, alone
from ..cluster.resources import RENDER
from ..cluster.task_loop import Cancelled, finished
from ..files.atomic import replacing, write_bytes
from .picture_cost import placed, refraction_bytes
from .refraction import tasks_of
from .refraction_view import RefractionView
from .scene_cache import stored_shape
from .tiles import submit

FORMATS = ("zip", "apng")
MOST_FRAMES = 720
# Of all frames; the packer of an APNG holds most of them at once.
MOST_PIXELS = 2**27
# Of a pixel that is not packed, and of what a picture and its entry in an archive say beside pixels.
PIXEL_BYTES, PICTURE_BYTES = 4, 4096
# Below a picture that somebody waits for.
PRIORITY = 0

FRAME_MS = 80
# Zip files keep a date; a fixed one makes the same frames the same file.
DATE = (1980, 1, 1, 0, 0, 0)


@dataclass(frozen=True)
class Turntable(RefractionView):
    """A view that goes round the volume.

    Raises:
        InvalidInput: naming the first field that is wrong.
    """

    frames: int = asked(36, "Pictures.", Range(1, MOST_FRAMES))
    turn_deg: float = asked(
        360.0,
        "How far the camera goes, degrees; the last picture is a step short of it.",
        Range(-3600.0, 3600.0),
    )
    format: Literal["zip", "apng"] = asked("zip", "zip: one PNG a picture; apng: an animated PNG.")

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.format not in FORMATS:
            raise InvalidInput("format", repr(self.format), "one of " + ", ".join(FORMATS))
        pixels = self.frames * self.width * self.height
        if pixels > MOST_PIXELS:
            raise InvalidInput(
                "frames", f"{self.frames}, {pixels} pixels in all", f"at most {MOST_PIXELS} pixels"
            )

    @property
    def largest_bytes(self) -> int:
        """Of its pictures and of the file that is made of them, as if nothing could be packed."""
        return 2 * (self.frames * (PIXEL_BYTES * self.width + 1) * self.height + PICTURE_BYTES * self.frames)

    def frame(self, number: int) -> RefractionView:
        """The view of one picture, from 0."""
        view: dict[str, Any] = {one.name: getattr(self, one.name) for one in fields(RefractionView)}
        view["azimuth_deg"] = (self.azimuth_deg + self.turn_deg * number / self.frames) % 360.0
        return RefractionView(**view)


def turn(
    client: Client,
    path: Path,
    turntable: Turntable,
    target: Path,
    work_dir: Path,
    on_progress: Callable[[Progress], None],
    on_saved: Callable[[], None],
    stop: Callable[[], bool],
    share: Share | None = None,
) -> None:
    """Draw all pictures on a cluster and write them to one file.

    Args:
        client: of the cluster.
        path: of a volume or reconstruction file, readable by every worker.
        turntable: what to draw.
        target: the file to write, by a worker, whole or not at all.
        work_dir: a folder for the pictures, readable by every worker; those that an unfinished run of the
            same turntable left there are not drawn again.
        on_progress: called after each picture.
        on_saved: the same.
        stop: polled between pictures; true ends with ``Cancelled``.
        share: of the workers; None: all of them.

    Raises:
        Cancelled: when ``stop`` said so.
        InvalidInput: from the file or the view.
    """
    frames = [work_dir / f"{number:04d}.png" for number in range(turntable.frames)]
    waiting = deque((number, frame) for number, frame in enumerate(frames) if not frame.exists())
    drawn = len(frames) - len(waiting)
    running: dict[Future, Path] = {}
    share = share or alone(client, "render")
    where = placed(refraction_bytes(stored_shape(path), turntable), offers_by_address(client))
    on_progress(Progress(drawn, len(frames)))
    try:
        while waiting or running:
            while share.may_begin(len(running), len(waiting)):
                number, frame = waiting.popleft()
                priority = PRIORITY + share.priority(len(running))
                running[submit(client, tasks_of(path, turntable.frame(number)), priority, where)] = frame
            if not running:
                share.wait()
            for future in finished(client, list(running)):
                write_bytes(running.pop(future), future.result())
                drawn += 1
                on_saved()
                on_progress(Progress(drawn, len(frames)))
            if stop():
                raise Cancelled
        pack = {"zip": write_zip, "apng": write_apng}[turntable.format]
        packing = client.submit(pack, frames, target, pure=False, resources=RENDER, priority=PRIORITY)
        running[packing] = target
        while not finished(client, [packing]):
            if stop():
                raise Cancelled
        packing.result()
    finally:
        for future in running:
            future.cancel()
        share.pause()


def write_zip(frames: Sequence[Path], target: Path) -> None:
    """Task: pictures side by side in a zip file; PNG is packed already."""
    with replacing(target) as partial, zipfile.ZipFile(partial, "w", zipfile.ZIP_STORED) as archive:
        for frame in frames:
            archive.writestr(zipfile.ZipInfo(frame.name, DATE), frame.read_bytes())


def write_apng(frames: Sequence[Path], target: Path) -> None:
    """Task: pictures one after the other in an animated PNG that begins again at its end."""
    with replacing(target) as partial, Image.open(frames[0]) as first:
        later = _Opened(frames[1:])
        first.save(partial, "PNG", save_all=True, append_images=later, duration=FRAME_MS, loop=0)


class _Opened:
    """Pictures that are opened one after the other, as often as they are asked for; Pillow asks twice."""

    def __init__(self, paths: Sequence[Path]) -> None:
        self._paths = paths

    def __iter__(self) -> Iterator[Image.Image]:
        for path in self._paths:
            with Image.open(path) as picture:
                yield picture
