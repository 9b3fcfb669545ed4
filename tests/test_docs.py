"""The examples of the documentation run, page by page, against a service that the test starts."""

import os
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
import typer
from PIL import Image

from bentray_service.cli import app
from bentray_service.cli.output.exit_codes import DOUBTFUL
from bentray_service.cli.service_process import running_service
from bentray_workers.files.dataset import write_dataset
from bentray_workers.simulation.plane import SimulationSettings
from bentray_workers.simulation.simulation_run import simulate

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
PAGES = sorted(DOCS.rglob("*.md"))
RECIPES = sorted((DOCS / "recipes").glob("*.py"))
# Of the gallery, which is made from the recipes when the documentation is built.
GALLERY = {"gallery/index", *(f"gallery/{recipe.stem}" for recipe in RECIPES)}
COMMANDS = typer.main.get_command(app).commands  # type: ignore[attr-defined]
BLOCK = re.compile(r"(?:<!-- not run: (.*?) -->\n)?```(sh|python)\n(.*?)```", re.DOTALL)
SAID = "http://127.0.0.1:8000"
# An id with an ellipsis stands for the newest one that an answer held.
ID = re.compile(r"\b(ds|job|vol|mesh|field|up)-([0-9a-z]{6,})\b")
PATIENCE_S = 240.0
BIGGEST_PICTURE = 300_000
GREEK = re.compile(
    r"\\(alpha|beta|gamma|delta|epsilon|eta|theta|kappa|lambda|mu|xi|rho|sigma|tau|phi|psi|omega|ell)\b"
)
# Without a unit: Landau's O, Euler's e, the imaginary unit and indices, the transpose.
PLAIN = {"O", "e", "i", "r", "T"}


@dataclass(frozen=True)
class Block:
    """One fenced example: its language, its lines, and why it is not run, if so."""

    language: str
    text: str
    left_out: str | None


def blocks(page: Path) -> list[Block]:
    return [Block(kind, text, why) for why, kind, text in BLOCK.findall(page.read_text())]


def filled_pages() -> list[Path]:
    """Those with something to run."""
    return [page for page in PAGES if any(not block.left_out for block in blocks(page))]


def shell_lines() -> list[str]:
    return [
        line
        for page in PAGES
        for block in blocks(page)
        if block.language == "sh"
        for line in block.text.splitlines()
    ]


@pytest.fixture(scope="module")
def scans(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The reader's own file: a scan with times."""
    folder = tmp_path_factory.mktemp("scans")
    settings = SimulationSettings(nodes=48, elements=24, coupling_mps=1375.0)
    write_dataset(folder / "scan.h5", simulate(settings, lambda _: None))
    return folder


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    folder = tmp_path_factory.mktemp("service")
    with pytest.MonkeyPatch.context() as environment:
        environment.setenv("BENTRAY_WORKERS", "1")
        with running_service(folder / "data", folder / "log") as url:
            yield url


class Reader:
    """Somebody who follows a page: in one folder, with the ids that the answers held."""

    def __init__(self, folder: Path, url: str) -> None:
        self.folder, self.url = folder, url
        self.seen: dict[str, str] = {}
        position, delta = _ring()
        self.names: dict[str, object] = {"position": position, "delta": delta}

    def follow(self, block: Block) -> None:
        text = block.text.replace(SAID, self.url)
        if block.language == "python":
            said = self._python(text)
        else:
            said = "".join(self.follow_line(line) for line in text.splitlines())
        for kind, number in ID.findall(said):
            self.seen[kind] = f"{kind}-{number}"

    def _filled(self, text: str) -> str:
        return re.sub(r"\b(ds|job|vol|mesh|field|up)-…", lambda match: self.seen[match[1]], text)

    def follow_line(self, line: str) -> str:
        if line.startswith("bentray submit"):
            line += f" --url {self.url}"
        said = self._run(["bash", "-euc", self._filled(line)])
        for kind, number in ID.findall(said):
            self.seen[kind] = f"{kind}-{number}"
        if line.startswith("curl") and "/v1/jobs" in line and '"kind"' in line:
            self._wait(self.seen["job"])
        assert "/problems/" not in said, said
        return said

    def _python(self, text: str) -> str:
        # The arrays that the reader has are in a file that the block is given as names.
        arrays = self.folder / "reader.npz"
        np.savez(arrays, **self.names)  # type: ignore[arg-type]
        begin = "import numpy as np\n" + "".join(
            f"{n} = np.load({str(arrays)!r})[{n!r}]\n" for n in self.names
        )
        return self._run([sys.executable, "-W", "error::SyntaxWarning", "-c", begin + self._filled(text)])

    def _wait(self, job: str) -> None:
        begin = "import bentray\n"
        code = f"{begin}with bentray.Client({self.url!r}) as client: print(client.wait({job!r}))"
        for kind, number in ID.findall(self._run([sys.executable, "-c", code])):
            self.seen[kind] = f"{kind}-{number}"

    def _run(self, command: list[str]) -> str:
        environment = {**os.environ, "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}"}
        done = subprocess.run(
            command,
            cwd=self.folder,
            env=environment,
            capture_output=True,
            text=True,
            timeout=PATIENCE_S,
            check=False,
        )
        # The examples are small: bentray may call their results doubtful.
        doubtful = done.returncode == DOUBTFUL and "Doubtful result." in done.stdout
        assert done.returncode == 0 or doubtful, f"{command[-1]}\n{done.stdout[-2000:]}{done.stderr[-2000:]}"
        return done.stdout


def _ring() -> tuple[np.ndarray, np.ndarray]:
    """Places of a ring, and what straight rays through a slow disc in its middle lose."""
    angle = 2 * np.pi * np.arange(24) / 24
    position = 0.09 * np.column_stack((np.cos(angle), np.sin(angle)))
    middle = (position[:, None] + position[None]) / 2
    chord = 2 * np.sqrt(np.maximum(0.04**2 - (middle**2).sum(axis=-1), 0.0))
    delta = chord / 1450.0 - chord / 1482.3
    delta[np.eye(24, dtype=bool)] = np.nan
    return position, delta


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("curl") is None, reason="no curl, which the examples use")
@pytest.mark.nightly
@pytest.mark.parametrize("page", filled_pages(), ids=lambda page: str(page.relative_to(DOCS)))
def test_the_examples_of_a_page_run(page: Path, service: str, scans: Path, tmp_path: Path) -> None:
    text = page.read_text()
    if "scan.h5" in text:
        shutil.copy(scans / "scan.h5", tmp_path)
    reader = Reader(tmp_path, service)
    if "traces.h5" in text:
        reader.follow_line(
            "bentray simulate -o traces.h5 --waveform --elements 24 --emissions 24 --side 0.05 "
            "--frequency 300000 --nodes 48"
        )
    for block in blocks(page):
        if not block.left_out:
            reader.follow(block)


def test_skipped_examples_have_a_reason_and_parse() -> None:
    for line in shell_lines():
        words = [word for word in shlex.split(line) if not re.fullmatch(r"[A-Z_]+=.*", word)]
        if words[0] != "bentray":
            continue
        command, rest = COMMANDS[words[1]], words[2:]
        while hasattr(command, "commands"):
            command, rest = command.commands[rest[0]], rest[1:]
        command.make_context(words[1], list(rest))


def test_links_of_every_page_resolve() -> None:
    for page in PAGES:
        text = page.read_text()
        for target in re.findall(r"\]\(([^)#]+)(?:#[^)]*)?\)", text):
            linked = (page.parent / target).resolve()
            built = linked.is_relative_to(DOCS) and str(linked.relative_to(DOCS).with_suffix("")) in GALLERY
            if "://" not in target:
                assert built or linked.exists(), f"{page.name}: {target}"
        for path in re.findall(r"`((?:deploy|benchmarks)/[\w./-]+)`", text):
            assert (ROOT / path).exists(), f"{page.name}: {path}"


def test_every_variable_that_the_code_reads_is_in_the_table(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(DOCS))
    from from_code.service_settings import settings_table

    words = r'"((?:BENTRAY|DASK|NUMBA|XDG|SSL|MPL|POCL|OCL|OPENCL_VENDOR|OTEL|AWS)[A-Z_]*[A-Z])"'
    read = {
        name
        for package in ("kernels", "workers", "service")
        for file in (ROOT / package).rglob("*.py")
        for name in re.findall(words, file.read_text())
    }
    # It is set for the linker of PoCL, not read from the user.
    read.remove("BENTRAY_PYTHON")
    assert {"NUMBA_CACHE_DIR", "SSL_CERT_FILE", "BENTRAY_KEY"} <= read
    assert read <= set(re.findall(r"`([A-Z_]+)`", settings_table()))


def test_the_tables_of_the_pages_are_those_of_the_code(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(DOCS))
    from from_code import BUILT, MARK, PARTS, filled

    shown: list[str] = []
    for page in PAGES:
        text = page.read_text()
        assert filled(text) == text, f"{page.name}: run `make tables`"
        shown += [mark[1] for mark in MARK.finditer(text)]
    assert sorted(shown) == sorted([*PARTS, *BUILT])


def test_every_page_is_in_the_contents() -> None:
    listed = re.findall(r"^((?:[\w-]+/)?[\w-]+)$", (DOCS / "index.md").read_text(), re.MULTILINE)
    pages = {str(page.relative_to(DOCS).with_suffix("")) for page in PAGES} - {"index"}
    assert pages | {"gallery/index"} == set(listed)


def test_recipes_have_a_title_and_link_to_pages() -> None:
    assert len(RECIPES) >= 12
    for recipe in RECIPES:
        text = recipe.read_text()
        title = re.match(r'"""(.+)\n(=+)\n\n.+\n', text)
        assert title, recipe.name
        assert len(title[1]) <= len(title[2]), recipe.name
        compile(text, recipe.name, "exec")
        for target in re.findall(r":doc:`/([^`]+)`", text):
            assert target in GALLERY or (DOCS / f"{target}.md").exists(), f"{recipe.name}: {target}"


def test_pictures_are_shown_small_and_in_full_colour() -> None:
    text = "".join(page.read_text() for page in PAGES)
    pictures = list((DOCS / "pictures").glob("*.png"))
    assert len(pictures) > 1
    for picture in pictures:
        assert picture.stat().st_size < BIGGEST_PICTURE, picture.name
        # Colour bars in fewer colours show wrong values.
        assert Image.open(picture).mode != "P", picture.name
        assert picture.name in text, picture.name


def symbols(text: str) -> set[str]:
    """Letters of the formulas of a text, without indices and words."""
    listed: set[str] = set()
    for block, line in re.findall(r"\$\$(.*?)\$\$|\$([^$\n]+)\$", text, re.DOTALL):
        formula = re.sub(r"\\(?:text|mathrm|begin|end)\{[^}]*\}", " ", block or line)
        formula = re.sub(r"_(?:\{[^{}]*\}|\\?\w)", "", formula)
        listed |= set(GREEK.findall(formula)) | set(
            re.findall("[a-zA-Z]", re.sub(r"\\[a-zA-Z]+", " ", formula))
        )
    return listed


@pytest.mark.parametrize("page", sorted((DOCS / "mathematics").glob("*.md")), ids=lambda page: page.stem)
def test_every_symbol_of_the_mathematics_has_a_unit(page: Path) -> None:
    text = page.read_text()
    begin = text.index("| symbol | meaning | unit |")
    table, rest = text[begin:].split("\n\n", 1)
    assert symbols(rest) - symbols(table) <= PLAIN
    for row in table.splitlines()[2:]:
        assert len([part for part in row.split("|") if part.strip()]) == 3, row
