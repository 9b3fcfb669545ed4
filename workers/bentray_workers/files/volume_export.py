"""Export of volumes to other file formats."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from bentray_kernels.errors import InvalidInput
from bentray_kernels.requests.limits import FREQUENCY_HZ
from bentray_kernels.tomography import Reconstruction

from .export.content import Content
from .export.registry import EXPORTED, FormatName
from .hdf5_reading import opened
from .quantities import ATTENUATION_DB, IMAGES, QUANTITIES, REFLECTION
from .reconstruction import reconstruction_in
from .volume import FORMAT, Volume, volume_in
from .volume_axes import Grid

ATTENUATION = IMAGES["attenuation"]
TITLES = {
    **{quantity.array: quantity.label[0].upper() + quantity.label[1:] for quantity in QUANTITIES.values()},
    ATTENUATION_DB: "Attenuation (dB/(cm MHz))",
}
ATTENUATION_UNITS = ("Np/m", "dB/cm/MHz")
# Entry of the provenance with the frequency of the attenuation.
FREQUENCY = "frequency_hz"
DB_CM_OF_NP_M = 20.0 / math.log(10.0) / 100.0


@dataclass(frozen=True)
class Selection:
    """The part of a reconstruction to export.

    Attributes:
        quantity: of formats with one image, of ``QUANTITIES``; of formats with all images ``reflection``
            selects that image, which has a grid of its own.
        attenuation: unit of the attenuation, of ``ATTENUATION_UNITS``.
        frequency_hz: for dB/cm/MHz; None: that of the scan.

    Raises:
        InvalidInput: naming the first invalid field.
    """

    quantity: str = "speed"
    attenuation: str = "Np/m"
    frequency_hz: float | None = None

    def __post_init__(self) -> None:
        for name, value, accepted in (
            ("quantity", self.quantity, QUANTITIES),
            ("attenuation", self.attenuation, ATTENUATION_UNITS),
        ):
            if value not in accepted:
                raise InvalidInput(name, repr(value)[:40], "one of " + ", ".join(accepted))
        if self.frequency_hz is not None:
            FREQUENCY_HZ.check("frequency", self.frequency_hz)


# Of what is written here; a service sends no stored export of another one. 2: positions in RAS or LPS.
REVISION = 2
# Size of a number, and of headers.
NUMBER_BYTES, HEADER_BYTES = 8, 64 * 2**10
# Of the description of a slice in DICOM, and of a chunk of OME-Zarr.
SLICE_BYTES = 8 * 2**10


def largest_bytes(shape: Sequence[int], *, uploaded: bool) -> int:
    """Largest size of a volume of this shape in any of the formats, bytes."""
    images = 1 if uploaded else len(IMAGES)
    return images * (NUMBER_BYTES * math.prod(shape) + SLICE_BYTES * shape[-1]) + HEADER_BYTES


def export_volume(
    volume: Path, *, target: Path, name: FormatName, selection: Selection | None = None
) -> None:
    """Task: write a volume or reconstruction file in another format.

    Args:
        volume: its file.
        target: the exported file, replaced atomically.
        name: a key of ``EXPORTED``.
        selection: of quantity and unit; None: the speed, and Np/m.

    Raises:
        InvalidInput: naming ``volume``, for content that the format cannot store, or a deleted volume; naming
            the field of the selection, for a quantity that the volume does not have.
        OSError: where the folder cannot be written to or the disk is full.
    """
    image = read_image(volume)
    try:
        export_image(image, target=target, name=name, selection=selection, seconds=volume.stat().st_mtime)
    except FileNotFoundError:
        # Deleting a volume removes its file and its exports, also unfinished ones.
        if not target.parent.is_dir():
            raise
        raise InvalidInput("volume", "one that was deleted during its export", "one that stays") from None


def read_image(path: Path) -> Reconstruction | Volume:
    """Read the file of a reconstruction or of a volume.

    Raises:
        InvalidInput: naming the first field that is missing or wrong, as ``read_dataset`` does.
    """
    with opened(path) as reader:
        uploaded = reader.text("", "format") == FORMAT
        return volume_in(reader) if uploaded else reconstruction_in(reader)


def export_image(
    image: Reconstruction | Volume,
    *,
    target: Path,
    name: FormatName,
    selection: Selection | None = None,
    seconds: float = 0.0,
) -> None:
    """Write a reconstruction or a volume in another format.

    Args:
        image: what to write.
        target: the exported file, replaced atomically.
        name: a key of ``EXPORTED``.
        selection: of quantity and unit; None: the speed, and Np/m.
        seconds: time of the image, s since 1970.

    Raises:
        InvalidInput: naming ``volume``, for content that the format cannot store; naming the field of the
            selection, for a quantity that the image does not have.
        OSError: where the folder cannot be written to or the disk is full.
    """
    chosen = selection or Selection()
    if isinstance(image, Volume):
        if chosen != Selection():
            given = f"{chosen.quantity}, {chosen.attenuation}"
            raise InvalidInput("quantity", given, "none: an uploaded volume has values only")
        images = {"values": image.values}
        content = Content(image.values, image.grid, image.title, images, seconds)
    else:
        content = _reconstructed(image, chosen, seconds)
    EXPORTED[name].write(target, content)


def _reconstructed(own: Reconstruction, chosen: Selection, seconds: float) -> Content:
    held = {path: getattr(own, name) for name, path in IMAGES.items()}
    images = {path: image for path, image in held.items() if image is not None}
    if chosen.attenuation != "Np/m" and ATTENUATION in images:
        frequency = _frequency(own.provenance, chosen)
        factor = DB_CM_OF_NP_M / (frequency * 1e-6)
        images = {
            ATTENUATION_DB if name == ATTENUATION else name: factor * image if name == ATTENUATION else image
            for name, image in images.items()
        }
    if chosen.quantity == "reflection" and own.reflection is not None:
        image = own.reflection
        return Content(
            image.db,
            Grid(image.spacing_m, image.origin_m),
            TITLES[REFLECTION],
            {REFLECTION: image.db},
            seconds,
        )
    selected = next((name for name in images if name.startswith(chosen.quantity)), None)
    if selected is None:
        present = ", ".join(name for name in QUANTITIES if own.image(name) is not None)
        raise InvalidInput("quantity", f"{chosen.quantity} of a result without it", present)
    grid = Grid(own.spacing_m, own.origin_m)
    return Content(images[selected], grid, TITLES[selected], images, seconds)


def _frequency(provenance: Mapping[str, str], chosen: Selection) -> float:
    """The frequency that an attenuation in dB/cm/MHz refers to, Hz."""
    if chosen.frequency_hz is not None:
        return chosen.frequency_hz
    try:
        frequency = float(provenance[FREQUENCY])
        FREQUENCY_HZ.check(FREQUENCY, frequency)
    except (KeyError, ValueError):
        accepted = "Np/m, or a frequency: the result states none"
        raise InvalidInput("attenuation", repr(chosen.attenuation), accepted) from None
    return frequency
