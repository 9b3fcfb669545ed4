"""Any scan with default settings: targets A1 to A3, one file for each, and a scan by k-Wave."""

from collections.abc import Iterable

from bentray_service.cli.output.benchmark_context import BenchmarkContext
from bentray_service.cli.output.benchmark_row import Row

from . import _any_array, _default_settings, _other_simulator, _without_water_shot

# Each measures the rows of one target.
TARGETS = (_without_water_shot.rows, _default_settings.rows, _any_array.rows, _other_simulator.rows)


def rows(context: BenchmarkContext) -> Iterable[Row]:
    """The rows of all targets."""
    for target in TARGETS:
        yield from target(context)
