"""NRRD: round trip of shapes, units and compressed values; no other file is ever opened."""

import gzip
import io
from contextlib import suppress

import nrrd
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from bentray_kernels.errors import InvalidInput
from bentray_workers.files.nrrd_reading import nrrd_image
from bentray_workers.files.volume import Volume
from bentray_workers.files.volume_formats import import_volume

from ...effort import effort
from .volumes import ramp, refused

PLAIN = "type: uint8\ndimension: 3\nsizes: 3 4 5\nencoding: raw\n"


def write(path, fields=PLAIN, data=None, end="\n"):
    path.write_bytes(f"NRRD0004\n{fields}{end}".encode() + (ramp().tobytes("F") if data is None else data))
    return path


@pytest.mark.parametrize("encoding", ["raw", "gzip"])
@pytest.mark.parametrize("dtype", ["u1", "<u2", ">i2", "<f4", ">f8"])
def test_a_file_of_pynrrd(tmp_path, encoding, dtype):
    path = tmp_path / "v.nrrd"
    own = {
        "encoding": encoding,
        "space directions": np.diag([0.5, 0.5, 2.0]),
        "space origin": [1.0, 2.0, 3.0],
    }
    nrrd.write(str(path), ramp(dtype=dtype), {"space": "right-anterior-superior", "content": "a head", **own})
    volume = import_volume(path)
    np.testing.assert_array_equal(volume.values, ramp(dtype=dtype))
    np.testing.assert_allclose(volume.spacing_m, (5e-4, 5e-4, 2e-3))
    np.testing.assert_allclose(volume.origin_m, (1e-3, 2e-3, 3e-3))
    assert volume.title == "a head"


@pytest.mark.parametrize(
    ("more", "spacing"),
    [
        ("", 1e-3),
        ("spacings: 2 2 2\n", 2e-3),
        ('spacings: 2 2 2\nunits: "cm" "cm" "cm"\n', 2e-2),
        ('spacings: 2 2 2\nspace units: "um" "um" "um"\nspace dimension: 3\n', 2e-6),
    ],
)
def test_units(tmp_path, more, spacing):
    np.testing.assert_allclose(import_volume(write(tmp_path / "v", PLAIN + more)).spacing_m, (spacing,) * 3)


def test_each_axis_has_its_own_unit(tmp_path):
    fields = PLAIN + 'spacings: 1 2 3\nunits: "mm" "m" "cm"\n'
    np.testing.assert_allclose(import_volume(write(tmp_path / "v", fields)).spacing_m, (1e-3, 2.0, 3e-2))
    turned = "space dimension: 3\nspace directions: (0,2,0) (3,0,0) (0,0,4)\nspace origin: (1,1,1)\n"
    volume = import_volume(write(tmp_path / "v", PLAIN + turned + 'space units: "mm" "m" "mm"\n'))
    np.testing.assert_allclose(volume.spacing_m, (3e-3, 2.0, 4e-3))
    np.testing.assert_allclose(volume.origin_m, (1e-3, 1.0, 1e-3))


def test_lines_may_end_as_on_windows(tmp_path):
    fields = PLAIN.replace("\n", "\r\n")
    path = tmp_path / "v"
    path.write_bytes(f"NRRD0004\r\n{fields}\r\n".encode() + ramp().tobytes("F"))
    np.testing.assert_array_equal(import_volume(path).values, ramp())


@pytest.mark.parametrize("encoding", ["raw", "gzip"])
def test_more_values_than_declared_are_rejected_unread(tmp_path, encoding):
    data = b"\0" * 200_000_000
    data = gzip.compress(data, 9) if encoding == "gzip" else data[:61]
    error = refused(write(tmp_path / "v", PLAIN.replace("raw", encoding), data))
    assert "more data after the values" in error.value


@pytest.mark.parametrize("byte", [-1, -4, -5, -8, -40])
def test_a_flipped_bit_in_packed_values_their_check_sum_or_length_is_rejected(tmp_path, byte):
    packed = bytearray(gzip.compress(ramp().tobytes("F"), compresslevel=0))
    packed[byte] ^= 1
    error = refused(write(tmp_path / "v", PLAIN.replace("raw", "gzip"), bytes(packed)))
    assert "damaged data" in error.value


@settings(max_examples=effort(20, 150), suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.text(st.characters(max_codepoint=126), max_size=60), st.integers(0, 60))
def test_a_damaged_header_is_read_or_refused_and_nothing_else(tmp_path, text, position):
    fields = PLAIN[:position] + text + PLAIN[position:]
    with suppress(InvalidInput):
        assert import_volume(write(tmp_path / "v", fields)).values.ndim == 3


@pytest.mark.parametrize("order", [(0, 1, 2), (2, 0, 1), (1, 0, 2)])
@pytest.mark.parametrize("sense", [(1, 1, 1), (-1, 1, 1), (-1, -1, 1), (1, -1, -1)])
def test_axes_in_any_order_and_sense_are_the_same_volume(tmp_path, order, sense):
    plain = ramp()
    steps, origin = np.array([0.5, 1.0, 2.0]), np.array([1.0, 2.0, 3.0])
    last = (np.array(plain.shape) - 1) * steps
    directions = np.diag(np.array(sense) * steps)[list(order)]
    start = origin + np.where(np.array(sense) < 0, last, 0.0)
    stored = plain[tuple(slice(None, None, step) for step in sense)].transpose(order)
    own = {"space directions": directions, "space origin": start, "space": "right-anterior-superior"}
    path = tmp_path / "turned.nrrd"
    nrrd.write(str(path), np.ascontiguousarray(stored), own)
    volume = import_volume(path)
    np.testing.assert_array_equal(volume.values, plain)
    np.testing.assert_allclose(volume.spacing_m, 1e-3 * steps)
    np.testing.assert_allclose(volume.origin_m, 1e-3 * origin)


def test_sheared_axes_are_rejected(tmp_path):
    path = write(tmp_path / "v.nrrd", PLAIN + "space: RAS\nspace directions: (1,0,0) (0.3,1,0) (0,0,1)\n")
    assert refused(path).field == "space directions"


@pytest.mark.parametrize(
    ("space", "signs"),
    [
        ("left-posterior-superior", (-1, -1, 1)),
        ("LPS", (-1, -1, 1)),
        ("left-anterior-superior", (-1, 1, 1)),
        ("LAS", (-1, 1, 1)),
        ("right-anterior-superior", (1, 1, 1)),
        ("RAS", (1, 1, 1)),
        ("3D-right-handed", (1, 1, 1)),
    ],
)
def test_whichever_way_the_space_goes_it_is_the_same_body(tmp_path, space, signs):
    """A node lies in the same place of the body whatever the file calls the way there."""
    steps, start = np.array([0.5, 1.0, 2.0]), np.array([1.0, 2.0, 3.0])
    own = {"space directions": np.diag(signs * steps), "space origin": signs * start, "space": space}
    nrrd.write(str(tmp_path / "v.nrrd"), ramp(), own)
    volume = import_volume(tmp_path / "v.nrrd")
    np.testing.assert_array_equal(volume.values, ramp())
    np.testing.assert_allclose(volume.spacing_m, 1e-3 * steps)
    np.testing.assert_allclose(volume.origin_m, 1e-3 * start)


MINS, NODES = "axis mins: -1 -2 10\n", "centerings: node node node\n"
TURNED = "space: LPS\nspacedirections: (-1,0,0) (0,-2,0) (0,0,5)\nspaceorigin: (1,2,10)\n"


@pytest.mark.parametrize(
    ("more", "steps", "origin"),
    [
        # Node 0 and the last node.
        (MINS + "axis maxs: 1 4 30\n" + NODES, (1, 2, 5), (-1, -2, 10)),
        ("axismins: -1 -2 10\naxismaxs: 1 4 30\ncenters: node node node\n", (1, 2, 5), (-1, -2, 10)),
        ("Axis Mins: -1 -2 10\nAXIS MAXS: 1 4 30\nCenterings: node node node\n", (1, 2, 5), (-1, -2, 10)),
        # The outer sides of the cells.
        (MINS + "axis maxs: 2 6 35\ncenterings: cell cell cell\n", (1, 2, 5), (-0.5, -1, 12.5)),
        (MINS + "axis maxs: 2 4 35\ncenterings: cell node cell\n", (1, 2, 5), (-0.5, -2, 12.5)),
        # Falling positions: the values are flipped.
        ("axis mins: 1 4 30\naxis maxs: -1 -2 10\n" + NODES, (1, 2, 5), (-1, -2, 10)),
        # One of them, with spacings.
        (MINS + "spacings: 1 2 5\ncenterings: cell node node\n", (1, 2, 5), (-0.5, -2, 10)),
        ("axis maxs: 1 4 30\nspacings: 1 2 5\n" + NODES, (1, 2, 5), (-1, -2, 10)),
        (
            MINS + "axis maxs: 1 4 30\nspacings: 1 nan 5\n" + NODES,
            (1, 2, 5),
            (-1, -2, 10),
        ),
        ("axis mins: -1 nan 10\nspacings: 1 2 5\ncenterings: node ??? node\n", (1, 2, 5), (-1, 0, 10)),
        ("spacings: 1 2 5\nthicknesses: 3 3 3\nkinds: space space space\n", (1, 2, 5), (0, 0, 0)),
        (TURNED + "spacings: 1 2 5\n", (1, 2, 5), (-1, -2, 10)),
        # Not a field but a pair of key and value.
        ("spacings: 1 2 5\naxis mins:=7 7 7\n", (1, 2, 5), (0, 0, 0)),
    ],
)
def test_every_statement_of_positions_counts(tmp_path, more, steps, origin):
    volume = import_volume(write(tmp_path / "v", PLAIN + more))
    np.testing.assert_allclose(volume.spacing_m, 1e-3 * np.array(steps))
    np.testing.assert_allclose(volume.origin_m, 1e-3 * np.array(origin))
    upright = ramp()[::-1, ::-1, ::-1] if more.startswith("axis mins: 1 4") else ramp()
    np.testing.assert_array_equal(volume.values, upright)


@pytest.mark.parametrize(
    ("more", "field"),
    [
        (MINS + "axis maxs: 1 4 30\n", "centerings"),
        (MINS + "axis maxs: 1 4 30\ncenterings: node ??? node\n", "centerings"),
        (MINS + "centerings: node node node\n", "axis mins"),
        (MINS + "axis maxs: -1 4 30\n" + NODES, "axis mins"),
        (MINS + "axis maxs: inf 4 30\n" + NODES, "axis mins"),
        (MINS + "axis maxs: 1 4 30\nspacings: 1 2 6\n" + NODES, "spacings"),
        (
            MINS
            + "axis maxs: 1 4 30\ncenterings: node node node\nspace dimension: 3\nspace origin: (1,1,1)\n",
            "space origin",
        ),
        (MINS + "space dimension: 3\nspace directions: (1,0,0) (0,2,0) (0,0,5)\n", "axis mins"),
        ("spacings: 1 2 6\nspace dimension: 3\nspace directions: (1,0,0) (0,2,0) (0,0,5)\n", "spacings"),
        ("thicknesses: 1 2 6\n", "spacings"),
        ("space: RAS\nspace directions: none (0,2,0) (0,0,5)\n", "space directions"),
        ("space: RAS\nspace directions: (1,0,0) (0,2,0)\n", "space directions"),
        ("space dimension: 2\nspace directions: (1,0) (0,2) (0,0)\n", "space directions"),
        ("space: RAST\nspace directions: (1,0,0,0) (0,2,0,0) (0,0,5,0)\n", "space directions"),
        ("space: 3D-left-handed\n", "space"),
        ("space: up-down-sideways\n", "space"),
        ("kinds: complex domain domain\n", "kinds"),
    ],
)
def test_positions_that_are_stated_in_part_or_twice_are_refused(tmp_path, more, field):
    assert refused(write(tmp_path / "v", PLAIN + more)).field == field


def test_an_order_of_bytes_is_not_guessed(tmp_path):
    path = write(tmp_path / "v", PLAIN.replace("uint8", "short"), ramp().astype("<i2").tobytes("F"))
    assert refused(path).field == "endian"


def test_values_right_after_the_header_may_be_said_so(tmp_path):
    np.testing.assert_array_equal(
        import_volume(write(tmp_path / "v", PLAIN + "byte skip: 0\n")).values, ramp()
    )


def test_a_stream_is_read_as_a_volume():
    header = b"NRRD0004\ntype: uchar\ndimension: 3\nsizes: 4 3 2\naxis mins: 0 0 0\naxis maxs: 3 4 3\n"
    header += b"centerings: node node node\nencoding: raw\n\n"
    values = np.arange(24, dtype=np.uint8)
    volume = Volume.from_image(nrrd_image(io.BytesIO(header + values.tobytes())))
    assert volume.spacing_m == pytest.approx((1e-3, 2e-3, 3e-3))
    assert np.array_equal(volume.values, values.reshape((4, 3, 2), order="F"))
