"""An image with its uncertainty beside the truth: which part of the nodes lies within how many deviations."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bentray_kernels.arrays import Flags, Floats
from bentray_kernels.tomography import Reconstruction
from bentray_service.cli.output.benchmark_row import Row

# Within so many standard deviations nodes are counted.
DEVIATIONS = 2.0


@dataclass(frozen=True)
class Judged:
    """An image with its uncertainty, compared with the truth.

    Attributes:
        name: of the scan, with the chosen model.
        result: the image.
        error: (nodes,), m/s, of the nodes with a deviation from the truth smoothed by the resolution width.
        deviation: (nodes,), m/s, their standard deviations.
        breast: (nodes,), whether they are in the breast.
        image_s, uncertainty_s: CPU time, s.
    """

    name: str
    result: Reconstruction
    error: Floats
    deviation: Floats
    breast: Flags
    image_s: float
    uncertainty_s: float

    @property
    def in_breast(self) -> tuple[Floats, Floats]:
        """Errors and standard deviations of the nodes in the breast, m/s."""
        return self.error[self.breast], self.deviation[self.breast]

    @property
    def within(self) -> float:
        """Part of the nodes in the breast within ``DEVIATIONS``."""
        return part_within([self], DEVIATIONS)


def part_within(judged: Sequence[Judged], deviations: float) -> float:
    """Part of all nodes in the breasts whose error is at most so many deviations."""
    return float(np.mean(np.concatenate([relative(image) for image in judged]) <= deviations))


def row_of(target: str, error: Floats, deviation: Floats, goal: float, about: str) -> Row:
    """The row of the part of some nodes within ``DEVIATIONS``.

    Args:
        target: its name without what is counted.
        error, deviation: (nodes,), absolute errors and standard deviations, m/s.
        goal: at least this part.
        about: the scans.
    """
    return Row(
        f"{target}, nodes within two deviations",
        float(np.mean(error <= DEVIATIONS * deviation)),
        goal,
        ">=",
        "",
        f"{about}; {error.size} nodes in the breast; {sizes(error, deviation)}",
    )


def sizes(error: Floats, deviation: Floats) -> str:
    """Root mean squares of errors and of deviations, in words."""
    return f"error {rms(error):.1f} m/s, deviations {rms(deviation):.1f} m/s"


def rms(values: Floats) -> float:
    """Root mean square."""
    return float(np.sqrt((values**2).mean()))


def relative(judged: Judged) -> Floats:
    """Absolute errors in the breast, in deviations."""
    error, deviation = judged.in_breast
    return np.asarray(np.abs(error) / deviation)


def correlation(judged: Judged) -> float:
    """Spearman's rank correlation of absolute error and deviation in the breast."""
    error, deviation = judged.in_breast
    ranks = [np.argsort(np.argsort(values)) for values in (np.abs(error), deviation)]
    return float(np.corrcoef(ranks)[0, 1])
