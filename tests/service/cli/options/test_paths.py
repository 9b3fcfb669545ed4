"""Paths are refused before work starts."""

from pathlib import Path

import pytest

from bentray_kernels.errors import InvalidInput
from bentray_service.cli.options.paths import check_apart, input_file, output_file, output_folder


def test_an_input_must_be_a_file(tmp_path: Path) -> None:
    (tmp_path / "scan.h5").touch()
    assert input_file(tmp_path / "scan.h5") == tmp_path / "scan.h5"
    with pytest.raises(InvalidInput, match="a folder"):
        input_file(tmp_path)
    with pytest.raises(InvalidInput, match="no such file"):
        input_file(tmp_path / "absent.h5")


def test_an_output_folder_is_made_with_its_parents(tmp_path: Path) -> None:
    assert output_folder(tmp_path / "a" / "b").is_dir()
    assert output_folder(tmp_path / "a" / "b").is_dir(), "and may be there already"


@pytest.mark.parametrize("below", ["", "deeper"])
def test_file_in_place_of_an_output_folder_is_named(tmp_path: Path, below: str) -> None:
    (tmp_path / "taken").touch()
    with pytest.raises(InvalidInput, match="a file is in the way"):
        output_folder(tmp_path / "taken" / below)


def test_an_output_file_is_overwritten_only_by_force(tmp_path: Path) -> None:
    path = tmp_path / "scan.h5"
    assert output_file(path, force=False) == path
    path.touch()
    with pytest.raises(InvalidInput, match="--force"):
        output_file(path, force=False)
    assert output_file(path, force=True) == path


def test_an_output_file_needs_a_folder_and_is_none(tmp_path: Path) -> None:
    with pytest.raises(InvalidInput, match="its folder does not exist"):
        output_file(tmp_path / "absent" / "scan.h5", force=True)
    with pytest.raises(InvalidInput, match=r"\(a folder\)"):
        output_file(tmp_path, force=True)


def test_a_folder_that_takes_no_file_is_rejected_before_the_work() -> None:
    with pytest.raises(InvalidInput, match="a writable folder"):
        output_folder(Path("/proc/self"))


def test_a_file_that_cannot_be_written_or_has_another_name_is_rejected_before_the_work(
    tmp_path: Path,
) -> None:
    with pytest.raises(InvalidInput, match="a writable folder"):
        output_file(Path("/proc/self/p.png"), force=False)
    with pytest.raises(InvalidInput, match=r"ending in \.png"):
        output_file(tmp_path / "p.jpg", force=False, suffix=".png")
    assert output_file(tmp_path / "P.PNG", force=False, suffix=".png").name == "P.PNG"


def test_outputs_and_inputs_lie_apart(tmp_path: Path) -> None:
    (tmp_path / "a").touch()
    (tmp_path / "link").symlink_to(tmp_path / "a")
    check_apart({"-o": tmp_path / "b", "--map": None}, {"file": tmp_path / "a", "other": tmp_path / "a"})
    with pytest.raises(InvalidInput, match="the same file as file"):
        check_apart({"-o": tmp_path / "link"}, {"file": tmp_path / "a"})
    with pytest.raises(InvalidInput, match=r"--map: .*the same file as -o"):
        check_apart({"-o": tmp_path / "b", "--map": tmp_path / ".." / tmp_path.name / "b"}, {})
