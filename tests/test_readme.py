"""The README and its neighbours are true: commands and addresses exist, tables hold the real defaults."""

import json
import re
import shlex
from importlib import import_module
from pathlib import Path
from urllib.parse import urlsplit

import numpy as np
import pytest
import typer

from bentray_kernels.tomography.settings import PLACES
from bentray_service.app import create_app
from bentray_service.cli import app
from bentray_service.jobs.kinds import KINDS
from bentray_service.settings import ServiceSettings
from bentray_workers.files.dataset import read_dataset

ROOT = Path(__file__).resolve().parents[1]
TEXTS = (
    "README.md",
    "CONTRIBUTING.md",
    "SECURITY.md",
    "deploy/README.md",
    "deploy/SCALING.md",
    "docs/how-to/use-over-http.md",
)
# Longer, and nobody reads it to the end.
LONGEST_README = 5000
COMMANDS = typer.main.get_command(app).commands  # type: ignore[attr-defined]


def shell_lines() -> list[tuple[str, list[str]]]:
    """Every command in a block of shell in the texts, as words; ``a && b`` are two."""
    results = []
    for name in TEXTS:
        for block in re.findall(r"```sh\n(.*?)```", (ROOT / name).read_text(), re.DOTALL):
            for line in block.splitlines():
                results += [(name, shlex.split(part)) for part in line.split(" && ")]
    return results


def lines_of(program: str) -> list[list[str]]:
    """The words after ``program`` on every line that runs it."""
    results = []
    for _, words in shell_lines():
        command = [word for word in words if not re.fullmatch(r"[A-Z_]+=.*", word)]
        if command[0].removeprefix(".venv/bin/") == program:
            results.append(command[1:])
    return results


def test_the_readme_opens_with_the_two_commands() -> None:
    block = re.search(r"```sh\n(.*?)```", (ROOT / "README.md").read_text(), re.DOTALL)
    assert block is not None
    assert block[1].splitlines() == ["make demo", "make test"]


def test_the_readme_is_short() -> None:
    assert len((ROOT / "README.md").read_text()) <= LONGEST_README


def test_readme_requirements_match_the_tests() -> None:
    programs = {words[0].removeprefix(".venv/bin/").split("=")[0] for _, words in shell_lines()}
    ours = {
        "bentray",
        "chmod",
        "deploy/check.sh",
        "deploy/secrets.sh",
        "deploy/certificates.sh",
        "DASK_SCHEDULER_ADDRESS",
        "BENTRAY_TLS_DIR",
        "BENTRAY_TRUSTED_PROXIES",
    }
    assert programs <= ours | {"git", "cd", "make", "curl", "dask", "docker", "ssh"}


@pytest.mark.parametrize("words", lines_of("bentray"), ids=" ".join)
def test_every_bentray_line_parses(words: list[str]) -> None:
    name, *rest = words
    command = COMMANDS[name]
    while hasattr(command, "commands"):
        name, *rest = rest
        command = command.commands[name]
    command.make_context(name, list(rest))


def test_every_target_of_make_exists() -> None:
    targets = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), re.MULTILINE))
    asked = {words[0] for words in lines_of("make")}
    assert {"demo", "test", "serve"} <= asked
    assert asked - targets == set()
    for name in TEXTS:
        mentioned = set(re.findall(r"`make ([a-z-]+)`", (ROOT / name).read_text()))
        assert mentioned - targets == set(), name


def test_every_address_of_curl_is_served(tmp_path: Path) -> None:
    served = {
        (method.upper(), re.compile(re.sub(r"\{\w+\}", "[^/]+", path)))
        for path, methods_of_path in create_app(ServiceSettings(data_dir=tmp_path)).openapi()["paths"].items()
        for method in methods_of_path
    }
    assert len(lines_of("curl")) == 16
    for words in lines_of("curl"):
        stated = words[words.index("-X") + 1] if "-X" in words else None
        method = stated or ("POST" if {"-d", "--data-binary"} & set(words) else "GET")
        url = next(word for word in words if word.startswith("http://"))
        assert any(m == method and p.fullmatch(urlsplit(url).path) for m, p in served), url
        for body in (words[n + 1] for n, word in enumerate(words) if word == "-d"):
            assert method == "PATCH" or json.loads(body)["kind"] in KINDS


def test_the_table_of_a_reconstruction_has_every_setting_its_default_and_its_option(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.syspath_prepend(ROOT / "docs")
    table = import_module("from_code.reconstruction_settings").reconstruction_settings()
    assert (
        "<!-- from the code: reconstruction settings -->"
        in (ROOT / "docs" / "reference" / "settings.md").read_text()
    )
    lines = table.splitlines()[2:]
    rows = {
        place: rest for place, *rest in ([c.strip() for c in line.strip("|").split("|")] for line in lines)
    }
    assert list(rows) == [f"`{place}`" for place in PLACES.values()]
    options = {option for param in COMMANDS["reconstruct"].params for option in param.opts}
    for default, _, option, meaning in rows.values():
        assert default
        assert meaning
        assert option.strip("`").partition("/")[0] in options


@pytest.mark.parametrize("name", [*TEXTS, "CHANGELOG.md"])
def test_every_file_that_a_text_points_to_exists(name: str) -> None:
    text = (ROOT / name).read_text()
    linked = {target for target in re.findall(r"\]\(([^)]+)\)", text) if "://" not in target}
    named = set(re.findall(r"`((?:kernels|workers|service|tests|benchmarks|deploy)/[\w./-]*)`", text))
    base = (ROOT / name).parent
    assert [path for path in linked if not (base / path).exists()] == []
    assert [path for path in named if not (ROOT / path).exists()] == []


def test_the_lines_that_write_a_scan_write_one_that_is_read_and_reconstructed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    write, reconstruct = re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text(), re.DOTALL)
    angle = 2 * np.pi * np.arange(8) / 8
    position = 0.1 * np.column_stack((np.cos(angle), np.sin(angle)))
    # A disk of 20 mm radius, faster than the water by 2 %, along straight rays.
    way = position[None] - position[:, None]
    length = np.linalg.norm(way, axis=-1) + np.eye(8)
    offset = np.abs(
        position[:, None, 0] * way[..., 1] - position[:, None, 1] * way[..., 0] - 0.02 * way[..., 1]
    )
    delta = -2.7e-5 * np.sqrt(np.maximum(0.02**2 - (offset / length) ** 2, 0.0))
    delta[0, 1] = np.nan
    monkeypatch.chdir(tmp_path)
    exec(write, {"position": position, "delta": delta})
    dataset = read_dataset(tmp_path / "scan.h5")
    np.testing.assert_array_equal(dataset.element_position_m, position)
    assert dataset.water_speed_mps == pytest.approx(1482.3, abs=0.1), "that of water of 20 degrees"
    assert np.isnan(dataset.differential_tof()[0, 1])
    exec(reconstruct, {})
    assert capsys.readouterr().out.startswith("(96, 96) ")
