"""Exports as the libraries of their users read them: the same numbers and units."""

import json
import math
import zipfile
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
from ome_zarr_models.v05.image import Image
from scipy.io import loadmat

from bentray_kernels.errors import InvalidInput
from bentray_kernels.tomography import Reconstruction
from bentray_workers.files.export import content
from bentray_workers.files.export.registry import EXPORTED
from bentray_workers.files.reconstruction import write_reconstruction
from bentray_workers.files.volume import Volume, write_volume
from bentray_workers.files.volume_export import Selection, export_volume, largest_bytes

from .reconstructions import made

FREQUENCY_HZ = 2.5e6
DB = Selection(attenuation="dB/cm/MHz", quantity="attenuation")


@pytest.fixture(scope="module", params=[None, 3], ids=["plane", "space"])
def result(request: pytest.FixtureRequest) -> Reconstruction:
    single = made(nodes=6, slices=request.param)
    spacing = (2e-3, 2e-3) if request.param is None else (2e-3, 2e-3, 5e-3)
    provenance = {**single.provenance, "frequency_hz": repr(FREQUENCY_HZ)}
    # Different sides, so that confused axes are found.
    crop = {name: getattr(single, name)[:, :4] for name in ("speed", "coverage", "attenuation", "recovery")}
    return replace(single, spacing_m=spacing, provenance=provenance, **crop)


@pytest.fixture(scope="module")
def stored(result: Reconstruction, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("result") / "reconstruction.h5"
    write_reconstruction(path, result)
    return path


def exported(stored: Path, tmp_path: Path, name: str, selection: Selection | None = None) -> Path:
    target = tmp_path / f"volume.{EXPORTED[name].download_extension}"
    export_volume(stored, target=target, name=name, selection=selection)
    return target


def in_db(result: Reconstruction) -> np.ndarray:
    return 20.0 / math.log(10.0) / 100.0 / (FREQUENCY_HZ * 1e-6) * result.attenuation


@pytest.mark.parametrize("name", ["nifti", "nrrd", "metaimage", "npy"])
@pytest.mark.parametrize("selection", [None, Selection(quantity="attenuation"), DB])
def test_formats_with_one_image(stored, result, tmp_path, name, selection):
    path = exported(stored, tmp_path, name, selection)
    expected = result.speed if selection is None else in_db(result) if selection == DB else result.attenuation
    if name == "npy":
        np.testing.assert_allclose(np.load(path), expected, rtol=1e-15)
        return
    if name == "nifti":
        image = nibabel.load(path)
        np.testing.assert_allclose(image.get_fdata(), expected, rtol=1e-15)
        return
    read = SimpleITK.GetArrayFromImage(SimpleITK.ReadImage(str(path))).T
    if name == "nrrd":
        np.testing.assert_array_equal(nrrd.read(str(path), index_order="F")[0], read)
        # A plane is a slice.
        read = read.reshape(expected.shape)
    np.testing.assert_allclose(read, expected, rtol=1e-15)


def test_matlab_has_all_images(stored, result, tmp_path):
    arrays = loadmat(exported(stored, tmp_path, "mat", DB))
    np.testing.assert_array_equal(arrays["speed_mps"], result.speed)
    np.testing.assert_allclose(arrays["attenuation_db_cm_mhz"], in_db(result))
    np.testing.assert_array_equal(arrays["spacing_m"], [result.spacing_m])
    assert arrays["axes"].item() == "x,y,z"[: 2 * result.speed.ndim - 1]
    assert "attenuation_np_m" not in arrays


def test_dicom_is_a_parametric_map_with_units(stored, result, tmp_path):
    path = exported(stored, tmp_path, "dicom", DB)
    image = highdicom.imread(path)
    assert image.SOPClassUID == pydicom.uid.ParametricMapStorage
    shape = result.speed.shape
    frames = 1 if len(shape) == 2 else shape[2]
    assert (image.Columns, image.Rows, image.NumberOfFrames) == (shape[0], shape[1], 2 * frames)
    pixels = image.pixel_array.reshape(2 * frames, shape[1], shape[0])
    found = {}
    for values, group in zip(pixels, image.PerFrameFunctionalGroupsSequence, strict=True):
        mapping = group.RealWorldValueMappingSequence[0]
        unit = mapping.MeasurementUnitsCodeSequence[0]
        assert (unit.CodingSchemeDesignator, mapping.RealWorldValueSlope) == ("UCUM", 1.0)
        position = [float(value) for value in group.PlanePositionSequence[0].ImagePositionPatient]
        found[unit.CodeValue, position[2]] = values
    for unit, expected in (("m/s", result.speed), ("dB/(cm.MHz)", in_db(result))):
        for k in range(frames):
            height = 0.0 if len(shape) == 2 else 1e3 * (result.origin_m[2] + k * result.spacing_m[2])
            values = found[unit, height]
            slice_ = expected if len(shape) == 2 else expected[:, :, k]
            np.testing.assert_allclose(values.T, slice_, rtol=1e-6)
    measures = image.SharedFunctionalGroupsSequence[0].PixelMeasuresSequence[0]
    assert list(measures.PixelSpacing) == [2.0, 2.0]


def test_ome_zarr_has_channels_with_units(stored, result, tmp_path):
    path = exported(stored, tmp_path, "ome-zarr")
    with zipfile.ZipFile(path) as archive:
        assert archive.namelist()[0] == "zarr.json"
        assert json.loads(archive.read("zarr.json"))["attributes"]["ome"]["version"] == "0.5"
    group = zarr.open_group(zarr.storage.ZipStore(path, mode="r"), mode="r")
    image = Image.from_zarr(group)
    scales = image.ome_attributes.multiscales[0]
    axes = ["c", "y", "x"] if result.speed.ndim == 2 else ["c", "z", "y", "x"]
    assert [axis.name for axis in scales.axes] == axes
    assert {axis.unit for axis in scales.axes[1:]} == {"meter"}
    scale, move = scales.datasets[0].coordinateTransformations
    np.testing.assert_allclose(scale.scale[1:], result.spacing_m[::-1])
    np.testing.assert_allclose(move.translation[1:], result.origin_m[::-1])
    labels = [channel["label"] for channel in group.attrs["ome"]["omero"]["channels"]]
    for label, expected in (
        ("speed_mps (m/s)", result.speed),
        ("attenuation_np_m (Np/m)", result.attenuation),
    ):
        np.testing.assert_array_equal(group["0"][labels.index(label)].T, expected)


def test_ome_zarr_is_written_to_a_new_folder(stored, result, tmp_path):
    target = tmp_path / "volume.ome.zarr"
    export_volume(stored, target=target, name="ome-zarr")
    np.testing.assert_array_equal(zarr.open_group(target, mode="r")["0"][0].T, result.speed)
    with pytest.raises(InvalidInput, match="exists"):
        export_volume(stored, target=target, name="ome-zarr")


def test_paraview_reads_all_images(stored, result, tmp_path):
    """By VTK, the library of ParaView, which takes 0.6 GB: extra ``bench``, not ``test``."""
    path = exported(stored, tmp_path, "vti")
    reader = pytest.importorskip("vtkmodules.vtkIOXML").vtkXMLImageDataReader()
    to_numpy = pytest.importorskip("vtkmodules.util.numpy_support").vtk_to_numpy
    reader.SetFileName(str(path))
    reader.Update()
    image = reader.GetOutput()
    ndim = result.speed.ndim
    assert image.GetDimensions()[:ndim] == result.speed.shape
    np.testing.assert_allclose(image.GetSpacing()[:ndim], result.spacing_m)
    np.testing.assert_allclose(image.GetOrigin()[:ndim], result.origin_m)
    data = image.GetPointData()
    assert data.GetScalars().GetName() == "speed_mps"
    for name, expected in (("speed_mps", result.speed), ("attenuation_np_m", result.attenuation)):
        values = to_numpy(data.GetArray(name)).reshape(result.speed.shape, order="F")
        np.testing.assert_array_equal(values, expected)


def test_vti_has_the_declared_data(stored, result, tmp_path):
    """Without VTK: XML before the data, and at each offset the size and the values."""
    content = exported(stored, tmp_path, "vti").read_bytes()
    before, _, after = content.partition(b'<AppendedData encoding="raw">_')
    root = ET.fromstring(before + b"</VTKFile>")
    assert (root.get("type"), root.get("header_type")) == ("ImageData", "UInt64")
    grid = root.find("ImageData")
    np.testing.assert_allclose(
        [float(v) for v in grid.get("Spacing").split()][: result.speed.ndim], result.spacing_m
    )
    for array in root.iter("DataArray"):
        begin = int(array.get("offset"))
        size = int(np.frombuffer(after, "<u8", 1, begin)[0])
        values = np.frombuffer(after, "<f8", size // 8, begin + 8).reshape(result.speed.shape, order="F")
        if array.get("Name") == "speed_mps":
            np.testing.assert_array_equal(values, result.speed)
    assert after.endswith(b"</AppendedData>\n</VTKFile>\n")


@pytest.mark.parametrize("name", EXPORTED)
def test_the_same_volume_gives_the_same_bytes_of_at_most_the_reserved_size(stored, result, tmp_path, name):
    first = exported(stored, tmp_path, name).read_bytes()
    assert exported(stored, tmp_path, name).read_bytes() == first
    assert len(first) <= largest_bytes(result.speed.shape, uploaded=False)


@pytest.mark.parametrize("name", EXPORTED)
def test_uploaded_volumes_are_exported(tmp_path, name):
    write_volume(
        tmp_path / "up.h5", Volume(np.ones((3, 4, 5), np.float32), (1e-3,) * 3, (0.0,) * 3, "a title")
    )
    assert exported(tmp_path / "up.h5", tmp_path, name).stat().st_size > 0
    with pytest.raises(InvalidInput, match="an uploaded volume has values only"):
        exported(tmp_path / "up.h5", tmp_path, name, Selection(quantity="attenuation"))


def test_rejects_unsupported_exports(tmp_path, monkeypatch):
    plain = replace(made(nodes=6), attenuation=None)
    write_reconstruction(tmp_path / "plain.h5", plain)
    with pytest.raises(InvalidInput, match="attenuation of a result without it"):
        exported(tmp_path / "plain.h5", tmp_path, "npy", Selection(quantity="attenuation"))
    write_reconstruction(tmp_path / "no-frequency.h5", made(nodes=6))
    with pytest.raises(InvalidInput, match="or a frequency: the result states none"):
        exported(tmp_path / "no-frequency.h5", tmp_path, "npy", DB)
    for wrong in ({"quantity": "colour"}, {"attenuation": "dB"}, {"frequency_hz": 0.0}):
        with pytest.raises(InvalidInput):
            Selection(**wrong)
    write_reconstruction(tmp_path / "uneven.h5", made(nodes=6, slices=2))
    for name in ("nifti", "metaimage", "nrrd", "vti", "ome-zarr", "dicom"):
        with pytest.raises(InvalidInput, match=r"^volume: .*hdf5 holds any"):
            exported(tmp_path / "uneven.h5", tmp_path, name)
        assert not list(tmp_path.glob("volume.*"))

    def missing(name):
        raise ImportError(name)

    monkeypatch.setattr(content, "import_module", missing)
    for name in ("ome-zarr", "dicom"):
        with pytest.raises(InvalidInput, match=r'pip install "bentray\[export\]"'):
            exported(tmp_path / "plain.h5", tmp_path, name)
