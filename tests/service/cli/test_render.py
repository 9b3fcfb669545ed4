"""`bentray render`: every format in, a picture and a map out, bad words in one line."""

import json
import time
from pathlib import Path

import nibabel
import nrrd
import numpy as np
import pytest
from PIL import Image

from bentray_kernels.phantoms import ONE_HOLE, sampled
from bentray_workers.files.volume import Volume, write_volume
from bentray_workers.rendering import refraction

from .conftest import Run

SMALL = ("--width", 32, "--height", 24)
BALL = sampled(ONE_HOLE, 12).astype(np.float32)


def npy(path: Path) -> None:
    np.save(path.open("wb"), BALL)


def raw(path: Path) -> None:
    path.write_bytes(BALL.tobytes(order="F"))


def of_nrrd(path: Path) -> None:
    nrrd.write(str(path), BALL, {"spacings": [1.0, 1.0, 1.0]})


def nifti(path: Path) -> None:
    path.write_bytes(nibabel.Nifti1Image(BALL, np.eye(4)).to_bytes())


def hdf5(path: Path) -> None:
    write_volume(path, Volume.from_values(BALL, (1e-3,) * 3))


@pytest.fixture
def volume(tmp_path: Path) -> Path:
    npy(tmp_path / "ball.npy")
    return tmp_path / "ball.npy"


def test_every_format_gives_the_same_picture(bentray: Run, tmp_path: Path) -> None:
    seen = set()
    for write in (npy, raw, of_nrrd, nifti, hdf5):
        path, png = tmp_path / f"{write.__name__}.volume", tmp_path / f"{write.__name__}.png"
        write(path)
        words = ("--shape", 12, 12, 12, "--dtype", "float32") if write is raw else ()
        result = bentray("render", path, "-o", png, *SMALL, "--iso", 0.5, *words)
        assert result.stdout.splitlines()[-1] == str(png)
        with Image.open(png) as picture:
            assert picture.size == (32, 24)
        seen.add(png.read_bytes())
    assert len(seen) == 1


@pytest.mark.parametrize("phantom", ["sphere", "one-hole", "two-holes", "marschner-lobb"])
def test_a_phantom_needs_no_file(bentray: Run, tmp_path: Path, phantom: str) -> None:
    result = bentray(
        "render", "-o", tmp_path / "p.png", "--phantom", phantom, "--nodes", 12, *SMALL, "--json"
    )
    said = json.loads(result.stdout)
    assert (said["shape"], said["rays"], said["view"]["width"]) == ([12, 12, 12], 32 * 24, 32)
    assert said["view"]["iso"] == [pytest.approx(sum(said["range"]) / 2)]
    assert said["map"] is None
    assert (tmp_path / "p.png").stat().st_size > 100


def test_map_contains_the_direction_of_each_pixel(bentray: Run, tmp_path: Path, volume: Path) -> None:
    words = ("--iso", 0.5, "--index", 1.0, "--map", tmp_path / "map.npy", "--spacing", 2e-3)
    bentray("render", volume, "-o", tmp_path / "p.png", *SMALL, *words)
    array = np.load(tmp_path / "map.npy")
    assert array.shape == (24, 32, 2)
    # An index of 1 bends nothing: 1.25 times the side of the volume over 24 pixels.
    np.testing.assert_allclose(np.diff(array[..., 0], axis=1), 1.25 * 0.022 / 24, rtol=1e-6)
    bent = (*words[:3], 1.5, *words[4:], "--force")
    bentray("render", volume, "-o", tmp_path / "p.png", *SMALL, *bent)
    assert not np.allclose(np.load(tmp_path / "map.npy"), array)


def test_a_backdrop_of_ones_own(bentray: Run, tmp_path: Path, volume: Path) -> None:
    Image.new("RGB", (8, 8), (10, 200, 30)).save(tmp_path / "green.bmp")
    words = ("--iso", 0.5, "--backdrop", tmp_path / "green.bmp")
    bentray("render", volume, "-o", tmp_path / "p.png", *SMALL, *words)
    with Image.open(tmp_path / "p.png") as picture:
        assert picture.getpixel((0, 0)) == (10, 200, 30)
    bentray("render", volume, "-o", tmp_path / "P.PNG", *SMALL)


def test_a_spacing_is_one_word_or_three(bentray: Run, tmp_path: Path, volume: Path) -> None:
    maps = []
    for words in ((2e-3,), (2e-3, 2e-3, 2e-3), (2e-3, 2e-3, 1e-3)):
        place = ("-o", tmp_path / "p.png", "--map", tmp_path / "m.npy", "--force")
        bentray("render", "--spacing", *words, volume, *place, *SMALL, "--iso", 0.5)
        maps.append(np.load(tmp_path / "m.npy"))
    np.testing.assert_array_equal(maps[0], maps[1])
    assert not np.array_equal(maps[0], maps[2])


def test_no_output_replaces_another_or_an_input(bentray: Run, tmp_path: Path) -> None:
    volume, link = tmp_path / "v.png", tmp_path / "link.png"
    npy(volume)
    link.symlink_to(volume)
    before = volume.read_bytes()
    same = tmp_path / "p.png"
    for words, field in (
        (("-o", volume), "--output"),
        (("-o", link), "--output"),
        (("-o", same, "--map", same), "--map"),
        (("-o", same, "--map", volume), "--map"),
        (("-o", same, "--backdrop", same), "--output"),
    ):
        said = bentray("render", volume, *words, "--force", *SMALL, code=2).stderr
        assert said.split()[1] == f"{field}:", said
    assert volume.read_bytes() == before


def test_an_interrupt_starts_no_more_tiles(
    bentray: Run, tmp_path: Path, volume: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    begun = []

    def interrupted(*given: object) -> None:
        begun.append(given)
        if len(begun) == 1:
            raise KeyboardInterrupt
        time.sleep(0.05)

    monkeypatch.setattr(refraction, "draw_tile", interrupted)
    many = ("--width", 16, "--height", 4096)
    bentray("render", volume, "-o", tmp_path / "p.png", "--iso", 0.5, *many, code=130)
    assert 0 < len(begun) < 20
    assert not (tmp_path / "p.png").exists()
