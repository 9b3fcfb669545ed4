"""Device memory of a batch of shots: tiles of emitters, and checkpoints where stored fields do not fit."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from ..errors import InvalidInput


@dataclass(frozen=True)
class ShotSize:
    """Numbers of an emitter's arrays on the device.

    Attributes:
        field: of a padded field.
        image: of the image alone, so of a stored field.
        slots: stored fields; 0: no gradient.
        samples: of all its traces, and as many of recorded ones and of their weights.
        itemsize: bytes of a number.
    """

    field: int
    image: int
    slots: int
    samples: int
    itemsize: int

    def held(self, segments: int) -> int:
        """Stored fields that are held at a time."""
        return -(-self.slots // segments)

    def bytes(self, segments: int) -> int:
        """Bytes of one emitter if the time loop is divided into segments.

        The stored fields of one segment are held at a time; those of the others are computed again from the
        pair of fields at its begin, beside the adjoint fields.
        """
        # Beside the adjoint fields, those of a checkpoint or of the begin.
        pairs = 1 if segments == 1 else 1 + max(1, segments - 2)
        images = 2 * self.image if self.slots else 0
        return self.itemsize * (
            2 * pairs * self.field + self.held(segments) * self.image + images + 3 * self.samples
        )

    def largest_bytes(self, segments: int) -> int:
        """Bytes of the largest of these arrays."""
        return self.itemsize * max(self.field, self.held(segments) * self.image, self.samples, self.image)


class ShotPlan(NamedTuple):
    """How many emitters are in flight, and how their time loop is divided.

    Attributes:
        emitters: at most.
        segments: of the time loop; with more than one, most steps forwards are made twice.
    """

    emitters: int
    segments: int

    @classmethod
    def for_memory(cls, size: ShotSize, limit_bytes: float, array_bytes: float) -> ShotPlan:
        """The plan with the fewest segments that holds an emitter.

        Args:
            size: of an emitter.
            limit_bytes: of all its arrays.
            array_bytes: of one array.

        Raises:
            InvalidInput: where no number of segments is enough, naming the bytes of both.
        """
        for segments in range(1, max(1, size.slots) + 1):
            whole, largest = size.bytes(segments), size.largest_bytes(segments)
            if whole <= limit_bytes and largest <= array_bytes:
                return cls(int(min(limit_bytes // whole, array_bytes // largest)), segments)
        least = min(range(1, max(1, size.slots) + 1), key=size.bytes)
        raise InvalidInput(
            "speed",
            f"{size.bytes(least)} bytes for an emitter, {size.largest_bytes(least)} of them in one array",
            f"at most {limit_bytes:.0f} bytes, {array_bytes:.0f} in one array, on the device",
        )
