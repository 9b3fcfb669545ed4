"""Writing volumes as DICOM Parametric Maps, one frame for each slice and quantity."""

import hashlib
import math
from collections.abc import Sequence
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bentray_kernels.errors import InvalidInput

from ..atomic import atomic_replace
from ..bounded_reading import UNITS_M
from ..quantities import ATTENUATION_DB
from ..volume_axes import LPS
from .content import Content, import_optional

# UCUM code and meaning of each quantity: name of the image, label, explanation.
QUANTITIES = {
    "speed_mps": ("SPEED", "Speed of sound", "m/s", "meter per second"),
    "attenuation_np_m": ("ATTENUATION", "Attenuation", "Np/m", "neper per meter"),
    ATTENUATION_DB: (
        "ATTENUATION",
        "Attenuation over frequency",
        "dB/(cm.MHz)",
        "decibel per centimeter and megahertz",
    ),
    "reflection_db": ("REFLECTION", "Reflection", "dB", "decibel"),
    "values": ("VALUES", "Values", "1", "no units"),
}
# Parametric maps have at most so many rows and columns.
MAX_NODES = 2**16 - 1
MAKER, MODEL, SCHEME = "Bentray", "bentray", "99BENTRAY"


def write(path: Path, content: Content) -> None:
    """Write the quantities of ``QUANTITIES``, as float32, as one Parametric Map; see ``ExportFormat.write``.

    Frames are slices across z, rows are along y and columns along x, in the order of the volume; positions
    are in mm in the patient axes of DICOM, LPS. Patient and study are empty. The same volume gives the same
    bytes.

    Raises:
        InvalidInput: for too many nodes, or without highdicom.
    """
    hd = import_optional("highdicom", "export", "DICOM")
    images, grid = content.images, content.grid
    names = [name for name in QUANTITIES if name in images]
    first = images[names[0]]
    if max(first.shape) > MAX_NODES:
        raise InvalidInput(
            "volume", f"{max(first.shape)} nodes", f"at most {MAX_NODES} along an axis for DICOM"
        )
    # (frames, rows, columns, quantities).
    pixels = np.stack([_frames(images[name]) for name in names], axis=-1)
    # Adding 0 makes −0 the same as 0.
    affine = LPS @ grid.affine(UNITS_M["mm"]) + 0.0
    steps = np.divide((*grid.spacing_m, grid.spacing_m[0])[:3], UNITS_M["mm"])
    orientation = tuple(_decimal(value) for value in (affine[:3, :2] / steps[:2]).T.ravel())
    positions = [
        tuple(_decimal(value) for value in affine[:3, 3] + k * affine[:3, 2]) for k in range(len(pixels))
    ]
    digest = hashlib.sha256(
        pixels.tobytes() + repr((names, content.title, *affine.ravel())).encode()
    ).hexdigest()
    source = _source(digest, pixels.shape[1:3], steps, orientation, positions[0])
    made = hd.pm.ParametricMap(
        source_images=[source],
        pixel_array=pixels,
        series_instance_uid=_uid(digest, "series"),
        series_number=1,
        sop_instance_uid=_uid(digest, "instance"),
        instance_number=1,
        manufacturer=MAKER,
        manufacturer_model_name=MODEL,
        software_versions=version("bentray"),
        device_serial_number="0",
        contains_recognizable_visual_features=False,
        real_world_value_mappings=[[_mapping(hd, name, images[name])] for name in names],
        voi_lut_transformations=[
            hd.VOILUTTransformation(
                window_center=float(np.mean([first.min(), first.max()])),
                window_width=max(float(np.ptp(first)), 1.0),
            )
        ],
        content_description=content.line[:64] or None,
        content_label="BENTRAY",
        pixel_measures=hd.PixelMeasuresSequence(
            pixel_spacing=(_decimal(steps[1]), _decimal(steps[0])),
            slice_thickness=_decimal(steps[2]),
            spacing_between_slices=_decimal(steps[2]),
        ),
        plane_orientation=hd.PlaneOrientationSequence(
            coordinate_system="PATIENT", image_orientation=orientation
        ),
        plane_positions=[
            hd.PlanePositionSequence(coordinate_system="PATIENT", image_position=position)
            for position in positions
        ],
    )
    _settle(made, digest, datetime.fromtimestamp(math.floor(content.seconds), UTC))
    with atomic_replace(path) as partial, partial.open("wb") as file:
        made.save_as(file)


def _frames(image: NDArray[Any]) -> NDArray[np.float32]:
    """(nz, ny, nx)."""
    stacked = image[..., None] if image.ndim == 2 else image
    return np.ascontiguousarray(stacked.transpose(2, 1, 0), dtype=np.float32)


def _source(
    digest: str,
    shape: Sequence[int],
    steps: NDArray[Any],
    orientation: Sequence[float],
    position: Sequence[float],
) -> Any:
    """An image of an anonymous patient in the frame of reference of the volume, which highdicom requires."""
    from pydicom.dataset import Dataset
    from pydicom.uid import UltrasoundImageStorage

    source = Dataset()
    source.SOPClassUID = UltrasoundImageStorage
    source.SOPInstanceUID = _uid(digest, "scan")
    source.StudyInstanceUID = _uid(digest, "study")
    source.SeriesInstanceUID = _uid(digest, "scan series")
    source.FrameOfReferenceUID = _uid(digest, "frame of reference")
    source.Modality = "US"
    source.Rows, source.Columns = (int(n) for n in shape)
    source.SliceThickness = _decimal(steps[2])
    source.PixelSpacing = [_decimal(steps[1]), _decimal(steps[0])]
    source.ImageOrientationPatient = list(orientation)
    source.ImagePositionPatient = list(position)
    for name in ("PatientID", "PatientName", "PatientBirthDate", "PatientSex", "AccessionNumber", "StudyID"):
        setattr(source, name, "")
    for name in ("StudyDate", "StudyTime", "ReferringPhysicianName", "PositionReferenceIndicator"):
        setattr(source, name, "")
    return source


def _settle(made: Any, digest: str, moment: datetime) -> None:
    """Replace the time of this export by that of the content, and random identifiers; no source image."""
    for word in ("Content", "InstanceCreation"):
        setattr(made, f"{word}Date", moment.strftime("%Y%m%d"))
        setattr(made, f"{word}Time", moment.strftime("%H%M%S"))
    for equipment in made.ContributingEquipmentSequence:
        equipment.ContributionDateTime = moment.strftime("%Y%m%d%H%M%S")
    for organization in (*made.DimensionOrganizationSequence, *made.DimensionIndexSequence):
        organization.DimensionOrganizationUID = _uid(digest, "dimensions")
    # highdicom requires one, but there is none.
    del made.ReferencedSeriesSequence, made.SourceImageSequence
    for frame in made.PerFrameFunctionalGroupsSequence:
        del frame.DerivationImageSequence


def _mapping(hd: Any, name: str, image: NDArray[Any]) -> Any:
    """Unit and meaning of a quantity; the values are stored as they are."""
    from pydicom.sr.coding import Code

    label, explanation, unit, meaning = QUANTITIES[name]
    return hd.pm.RealWorldValueMapping(
        lut_label=label,
        lut_explanation=explanation,
        unit=Code(unit, "UCUM", meaning),
        value_range=(float(image.min()), float(image.max())),
        slope=1.0,
        intercept=0.0,
        quantity_definition=Code(label, SCHEME, explanation),
    )


def _uid(digest: str, what: str) -> str:
    from pydicom.uid import generate_uid

    return str(generate_uid(entropy_srcs=[digest, what]))


def _decimal(value: float) -> float:
    """A number with at most 16 characters, as DICOM stores decimals."""
    from pydicom.valuerep import format_number_as_ds

    return float(format_number_as_ds(float(value)))
