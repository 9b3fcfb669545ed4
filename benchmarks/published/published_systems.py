"""Systems of the dissertation beside ours: rays, wave fronts, images, lookups, backdrops."""

from collections.abc import Iterable

from bentray_service.cli.output.benchmark_context import BenchmarkContext
from bentray_service.cli.output.benchmark_row import Row

from ._published_images import image_rows
from ._published_pictures import backdrop_rows, lookup_rows
from ._published_rays import front_rows, ray_rows
from ._speed_updates import SEEDS
from ._speed_updates import rows as update_rows

PARTS = (
    ("rays", lambda quick, progress: ray_rows(quick)),
    ("wave fronts", lambda quick, progress: front_rows(quick)),
    ("images", image_rows),
    ("speed updates", lambda quick, progress: update_rows(1 if quick else SEEDS)),
    ("lookups", lambda quick, progress: lookup_rows(quick)),
    ("backdrops", lambda quick, progress: backdrop_rows(quick)),
)


def rows(context: BenchmarkContext) -> Iterable[Row]:
    """One table; each row names both figures, and its goal is that ours is no worse."""
    for number, (name, table) in enumerate(PARTS):
        context.progress(number, len(PARTS), name)
        yield from table(context.quick, context.progress)
    context.progress(len(PARTS), len(PARTS), "done")
