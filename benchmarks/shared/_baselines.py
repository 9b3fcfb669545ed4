"""Baselines of an image error: best constant, water alone, straight rays likewise, and default settings."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

from bentray_kernels.acquisition import Dataset
from bentray_kernels.tomography import Reconstruction, Settings, reconstruct
from bentray_service.cli.output.benchmark_row import (
    BEST_CONSTANT,
    DEFAULT_SETTINGS,
    STRAIGHT_RAYS,
    WATER_ALONE,
    Row,
)
from bentray_service.cli.output.terminal import Step

from ._image_error import ErrorOn


class Image(NamedTuple):
    """A reconstruction and its wall-clock time, s."""

    result: Reconstruction
    seconds: float


@dataclass(frozen=True)
class Compared:
    """Error of an image and of its baselines, in one unit."""

    error: float
    baselines: Mapping[str, float]

    def row(
        self, target: str, value: float, goal: float, op: str, unit: str, detail: str, *, tuned: bool = False
    ) -> Row:
        """The row of a value that is about this error."""
        return Row(target, value, goal, op, unit, detail, self.error, self.baselines, tuned)


class Images:
    """Reconstructions of one dataset; each is made once."""

    def __init__(
        self,
        dataset: Dataset,
        run: Callable[[Dataset, Settings], Reconstruction],
        default: Settings | None = None,
    ) -> None:
        """Nothing is reconstructed yet.

        Args:
            dataset: a scan.
            run: reconstructs it.
            default: in place of ``Settings()``, only where the automatic grid would take too long.
        """
        self.dataset = dataset
        self._run = run
        self._default = default or Settings()
        self._made: dict[Settings, Image] = {}

    @classmethod
    def here(
        cls, dataset: Dataset, progress: Step, name: str = "", default: Settings | None = None
    ) -> Images:
        """Images that are made in this process; the progress names the method and the scan."""

        def run(scan: Dataset, settings: Settings) -> Reconstruction:
            what = f"{settings.rays} {settings.method}{name and ', '}{name}"
            return reconstruct(scan, settings, lambda now: progress(now.done, now.total, what))

        return cls(dataset, run, default)

    def made(self, settings: Settings) -> Image:
        """The image by some settings."""
        if settings not in self._made:
            begun = time.perf_counter()
            result = self._run(self.dataset, settings)
            self._made[settings] = Image(result, time.perf_counter() - begun)
            # Settings that were left open are known now, so that ``straight`` finds what was made before.
            self._made.setdefault(result.settings, self._made[settings])
        return self._made[settings]

    def default(self) -> Image:
        """The image by the default settings."""
        return self.made(self._default)

    def straight(self, image: Reconstruction) -> Reconstruction:
        """The image along straight rays by the same method, penalty and width; for FWI those of ``auto``."""
        settings = image.settings
        if settings.method == "waveform":
            image = self.default().result
            settings = image.settings
        if settings.rays == "straight":
            return image
        plain = Settings()
        fronts = {"eikonal": plain.eikonal, "speed_range_mps": plain.numerics.speed_range_mps}
        return self.made(settings.changed(rays="straight", **fronts)).result

    def compared(
        self, image: Reconstruction, error_on: ErrorOn, straight: Reconstruction | None = None
    ) -> Compared:
        """Error of an image and its baselines.

        Args:
            image: on any grid.
            error_on: gives the error on a grid.
            straight: in place of ``self.straight``.
        """
        error = error_on(image)
        constants = {BEST_CONSTANT: error.best_constant, WATER_ALONE: self._water(error.quantity)}
        images = {STRAIGHT_RAYS: straight or self.straight(image), DEFAULT_SETTINGS: self.default().result}
        return Compared(
            error.of(image),
            {name: error.of_constant(value) for name, value in constants.items()}
            | {name: error_on(image).of(image) for name, image in images.items()},
        )

    def _water(self, quantity: str) -> float:
        if quantity == "speed":
            return self.dataset.water_speed_mps
        return self.dataset.water_attenuation_np_m or 0.0
