"""One marker in every export: the same place for the library of each format, and for files that come back."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree as ET

import highdicom
import nibabel
import nrrd
import numpy as np
import pydicom
import pytest
import SimpleITK
import zarr
from nibabel.orientations import axcodes2ornt
from ome_zarr_models.v05.image import Image

from bentray_kernels.errors import InvalidInput
from bentray_kernels.tomography import Reconstruction
from bentray_workers.files.export.registry import EXPORTED
from bentray_workers.files.truth_file import read_truth
from bentray_workers.files.volume import Volume, read_volume, write_volume
from bentray_workers.files.volume_export import export_image
from bentray_workers.files.volume_formats import import_volume
from bentray_workers.images.slice import volume_slice_png

from .reconstructions import made

STEPS, CORNER, MARKER = np.array([1e-3, 2e-3, 3e-3]), np.array([-0.006, -0.01, 0.02]), (9, 6, 5)
# From the axes of ITK and DICOM, which go to the left and back, and back.
LPS = np.array([-1.0, -1.0, 1.0])
WATER, BRIGHT = 1480.0, 1600.0


def turned(*degrees: float) -> np.ndarray:
    """Rotations about x, then y, then z."""
    made = np.eye(3)
    for axis, angle in enumerate(np.radians(degrees)):
        first, c, s = np.eye(3), np.cos(angle), np.sin(angle)
        k, m = (axis + 1) % 3, (axis + 2) % 3
        first[k, k] = first[m, m] = c
        first[k, m], first[m, k] = -s, s
        made = first @ made
    return made


def solid(direction: np.ndarray | None = None) -> Volume:
    values = np.full((12, 10, 8), WATER, np.float32)
    values[MARKER] = BRIGHT
    return Volume.from_values(
        values, STEPS, CORNER, **({} if direction is None else {"direction": direction})
    )


def plane() -> Reconstruction:
    speed = np.full((12, 10), WATER)
    speed[MARKER[:2]] = BRIGHT
    extra = {"coverage": np.zeros((12, 10)), "attenuation": None, "recovery": None}
    grid = {"spacing_m": tuple(STEPS[:2]), "origin_m": tuple(CORNER[:2])}
    return replace(made(nodes=12), speed=speed, **extra, **grid)


OBLIQUE = turned(20.0, -10.0, 30.0)
IMAGES = {"plane": plane, "even": solid, "oblique": lambda: solid(OBLIQUE)}
PLACE = {
    "plane": [*(CORNER + STEPS * MARKER)[:2], 0.0],
    "even": CORNER + STEPS * MARKER,
    "oblique": CORNER + OBLIQUE @ (STEPS * MARKER),
}


def index(values: np.ndarray) -> np.ndarray:
    """Index of the brightest node, in three axes."""
    nodes = np.argwhere(values > 0.5 * (WATER + BRIGHT))
    assert len(nodes) == 1
    return np.append(nodes[0], [0.0] * (3 - values.ndim))


def by_nibabel(path: Path) -> np.ndarray:
    image = nibabel.load(path)
    assert image.header.get_xyzt_units()[0] == "mm"
    np.testing.assert_allclose(image.get_qform(), image.get_sform(), atol=1e-5)
    return 1e-3 * (image.affine @ [*index(image.get_fdata()), 1.0])[:3]


def by_itk(path: Path) -> np.ndarray:
    image = SimpleITK.ReadImage(str(path))
    node = index(SimpleITK.GetArrayFromImage(image).T)[: image.GetDimension()]
    position = image.TransformContinuousIndexToPhysicalPoint(node)
    return 1e-3 * LPS * np.append(position, [0.0] * (3 - len(node)))


def by_pynrrd(path: Path) -> np.ndarray:
    values, header = nrrd.read(str(path))
    assert (header["space"], header["space units"]) == ("right-anterior-superior", ["mm"] * 3)
    return 1e-3 * (header["space origin"] + index(values) @ header["space directions"])


def by_highdicom(path: Path) -> np.ndarray:
    volume = highdicom.imread(path).get_volume(real_world_value_map_selector=0)
    return 1e-3 * LPS * (volume.affine @ [*index(np.asarray(volume.array)), 1.0])[:3]


def by_pydicom(path: Path) -> np.ndarray:
    """Position by PS3.3 C.7.6.2.1.1."""
    image = pydicom.dcmread(path)
    pixels = image.pixel_array.reshape(-1, image.Rows, image.Columns)
    frame, row, column = (int(k) for k in np.argwhere(pixels > 0.5 * (WATER + BRIGHT))[0])
    shared, own = image.SharedFunctionalGroupsSequence[0], image.PerFrameFunctionalGroupsSequence[frame]
    between_rows, between_columns = shared.PixelMeasuresSequence[0].PixelSpacing
    along = np.array(shared.PlaneOrientationSequence[0].ImageOrientationPatient, float)
    position = np.array(own.PlanePositionSequence[0].ImagePositionPatient, float)
    return 1e-3 * LPS * (position + along[:3] * between_columns * column + along[3:] * between_rows * row)


def by_zarr(path: Path) -> np.ndarray:
    group = zarr.open_group(zarr.storage.ZipStore(path, mode="r"), mode="r")
    scales = Image.from_zarr(group).ome_attributes.multiscales[0]
    axes = [(axis.name, axis.orientation["value"]) for axis in scales.axes[1:]][::-1]
    ways = [("x", "left-to-right"), ("y", "posterior-to-anterior"), ("z", "inferior-to-superior")]
    assert axes == ways[: len(axes)]
    scale, move = scales.datasets[0].coordinateTransformations
    values = np.asarray(group["0"][0]).T
    position = np.array(move.translation[:0:-1]) + np.array(scale.scale[:0:-1]) * index(values)[: values.ndim]
    return np.append(position, [0.0] * (3 - len(position)))


def by_xml(path: Path) -> np.ndarray:
    """By VTK's documentation; its library, for ``by_vtk``, has 0.6 GB: extra ``bench``, not ``test``."""
    before, _, after = path.read_bytes().partition(b'<AppendedData encoding="raw">_')
    grid = ET.fromstring(before + b"</VTKFile>").find("ImageData")
    corner, step, direction = (
        np.array(grid.get(name).split(), float) for name in ("Origin", "Spacing", "Direction")
    )
    shape = np.array(grid.get("WholeExtent").split(), int)[1::2] + 1
    array = next(one for one in grid.iter("DataArray") if one.get("Name") in ("speed_mps", "values"))
    kind = {"Float32": "<f4", "Float64": "<f8"}[array.get("type")]
    values = np.frombuffer(after, kind, shape.prod(), int(array.get("offset")) + 8).reshape(shape, order="F")
    return corner + direction.reshape(3, 3) @ (step * index(values))


def by_vtk(path: Path) -> np.ndarray:
    reader = pytest.importorskip("vtkmodules.vtkIOXML").vtkXMLImageDataReader()
    reader.SetFileName(str(path))
    reader.Update()
    image = reader.GetOutput()
    low_high = image.GetPointData().GetScalars().GetRange()
    assert low_high == (WATER, BRIGHT)
    scalars = image.GetPointData().GetScalars()
    node = next(k for k in range(scalars.GetNumberOfTuples()) if scalars.GetTuple1(k) == BRIGHT)
    return np.array(image.GetPoint(node))


READERS = [
    ("nifti", by_nibabel),
    ("nifti", by_itk),
    ("nrrd", by_itk),
    ("nrrd", by_pynrrd),
    ("metaimage", by_itk),
    ("dicom", by_highdicom),
    ("dicom", by_pydicom),
    ("ome-zarr", by_zarr),
    ("vti", by_xml),
    ("vti", by_vtk),
]


@pytest.mark.parametrize("kind", IMAGES)
@pytest.mark.parametrize(("name", "read"), READERS)
def test_a_marker_is_in_the_same_place_for_every_library(
    tmp_path: Path, kind: str, name: str, read: Callable[[Path], np.ndarray]
) -> None:
    path = tmp_path / f"v.{EXPORTED[name].download_extension}"
    if (kind, name) == ("oblique", "ome-zarr"):
        with pytest.raises(InvalidInput, match=r"turned by .* degrees against x, y and z"):
            export_image(IMAGES[kind](), target=path, name=name)
        return
    export_image(IMAGES[kind](), target=path, name=name)
    np.testing.assert_allclose(read(path), PLACE[kind], atol=1e-8)


def by_another_program(path: Path, target: Path, axes: str | None) -> None:
    """Save a file again: by ITK, or by nibabel with axes in another order."""
    if axes is None:
        SimpleITK.WriteImage(SimpleITK.ReadImage(str(path)), str(target))
    else:
        image = nibabel.load(path)
        now = nibabel.io_orientation(image.affine)
        change = nibabel.orientations.ornt_transform(now, axcodes2ornt(axes))
        nibabel.save(image.as_reoriented(change), target)


@pytest.mark.parametrize("kind", IMAGES)
@pytest.mark.parametrize(
    ("name", "again", "axes"),
    [(name, again, None) for name in ("nifti", "nrrd", "metaimage") for again in ("nrrd", "nii", "nii.gz")]
    + [("nifti", "nii", axes) for axes in ("LPS", "SAR", "PIR")],
)
def test_a_file_that_another_program_saved_lands_where_it_was(
    tmp_path: Path, kind: str, name: str, again: str, axes: str | None
) -> None:
    image = IMAGES[kind]()
    if axes and isinstance(image, Reconstruction):
        pytest.skip("nibabel reorients three axes")
    path, target = tmp_path / f"v.{EXPORTED[name].download_extension}", tmp_path / f"again.{again}"
    export_image(image, target=path, name=name)
    by_another_program(path, target, axes)
    if isinstance(image, Reconstruction):
        if again == "nrrd" and name != "nrrd":
            with pytest.raises(InvalidInput, match="none beside the space directions of a plane"):
                read_truth(target, image)
            return
        truth = read_truth(target, image).truth
        np.testing.assert_array_equal(truth.sound_speed_mps, image.speed)
        grids = [(one.spacing_m, one.origin_m) for one in (truth, image)]
        np.testing.assert_allclose(*grids, rtol=1e-6)
        return
    back = import_volume(target)
    np.testing.assert_array_equal(back.values, image.values)
    np.testing.assert_allclose(back.grid.affine(), image.grid.affine(), atol=2e-8)
    write_volume(tmp_path / "v.h5", back)
    np.testing.assert_array_equal(read_volume(tmp_path / "v.h5").grid.affine(), back.grid.affine())


def test_pictures_of_an_oblique_volume_say_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    notes = []
    drawn = "bentray_workers.images.slice.plane_png"
    monkeypatch.setattr(drawn, lambda *_, note, **__: notes.append(note) or b"")
    for number, degrees in enumerate((0.0, 7.0)):
        write_volume(tmp_path / f"{number}.h5", solid(turned(0.0, 0.0, degrees)))
        volume_slice_png(tmp_path / f"{number}.h5")
    assert notes == ["", "turned by 7.00 degrees against x, y and z"]


def test_an_oblique_truth_is_refused_with_its_angle(tmp_path: Path) -> None:
    export_image(solid(turned(0.0, 0.0, 7.0)), target=tmp_path / "v.nii", name="nifti")
    with pytest.raises(InvalidInput, match=r"truth: found a grid turned by 7\.00 degrees"):
        read_truth(tmp_path / "v.nii", plane())


@pytest.mark.parametrize("wrong", [np.zeros((3, 3)), 2.0 * np.eye(3), np.full((3, 3), np.nan), np.eye(2)])
def test_directions_that_are_none_are_refused(wrong: np.ndarray) -> None:
    with pytest.raises(InvalidInput, match="orthonormal"):
        solid(wrong)
