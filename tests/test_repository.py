"""The repository itself: first lines, lock files, and no paths of one machine."""

import ast
import re
import subprocess
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
LOCKS = {
    "requirements.lock": ("build", "export", "postgres"),
    "requirements-dev.lock": ("build", "export", "postgres", "test", "lint"),
    "requirements-image.lock": ("build", "export", "postgres", "slurm", "kubernetes", "otel"),
}

# Folders of one machine, and hosts of package indexes; spelt so that this file does not contain them.
MACHINE_PATH = re.compile(r"(?<![\w./-])/(?:work|root|opt|Users|home/(?!bentray\b)\w+)/[\w.]")
INDEX_HOST = re.compile(
    r"py[p]i\.|python[h]osted|npm[j]s|[-]-(?:extra-)?index-url[ =]|find-[l]inks", re.IGNORECASE
)


def committed() -> list[Path]:
    """The files that git knows, present in this tree."""
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=True)
    return [path for name in listed.stdout.split("\0") if name and (path := ROOT / name).is_file()]


def committed_texts() -> list[tuple[str, str]]:
    """Name and content of every committed text file."""
    texts = []
    for path in committed():
        content = path.read_bytes()
        if b"\0" not in content:
            texts.append((str(path.relative_to(ROOT)), content.decode()))
    return texts


def test_every_source_file_starts_with_its_purpose() -> None:
    without = []
    for path in committed():
        if path.suffix != ".py":
            continue
        first = (ast.get_docstring(ast.parse(path.read_text())) or "").partition("\n")[0].strip()
        # Recipes of the gallery open with their title.
        if first and path.parent == ROOT / "docs" / "recipes":
            continue
        if not first.endswith((".", "?")) or not path.read_text().startswith(('"""', 'r"""')):
            without.append(str(path.relative_to(ROOT)))
    assert without == []


def test_no_file_is_named_for_having_no_job() -> None:
    vague = {"utils", "util", "helpers", "helper", "common", "misc"}
    assert [str(path) for path in committed() if {path.stem, *path.parts} & vague] == []


def test_no_file_names_a_folder_of_somebodys_machine() -> None:
    result = [(name, match[0]) for name, text in committed_texts() if (match := MACHINE_PATH.search(text))]
    assert result == []


def test_no_file_names_a_package_index() -> None:
    result = [(name, match[0]) for name, text in committed_texts() if (match := INDEX_HOST.search(text))]
    assert result == []


def test_no_test_moves_the_clock_of_all_threads() -> None:
    # The event loops of other tests' clusters would wait until the true time has caught up.
    moved = re.compile(
        r"""setattr\(\s*(?:[\w.]*\btime,\s*|["'][\w.]*\btime\.)["']?(?:time|monotonic|sleep)\b"""
    )
    assert moved.search("monkeypatch.setattr(module." + 'time, "time", later)')
    assert [name for name, text in committed_texts() if name.endswith(".py") and moved.search(text)] == []


@pytest.mark.parametrize("folder", ["root", "work", "opt", "home/ann", "Users"])
@pytest.mark.parametrize("line", ["see /{}/x", "'/{}/x'", "(/{}/x)", "path=/{}/x"])
def test_the_search_for_machine_folders_finds_them(line: str, folder: str) -> None:
    assert MACHINE_PATH.search(line.format(folder))


@pytest.mark.parametrize(
    "line", ["/v1/jobs", "a/work/b", "https://x.org/opt/y", "/home/bentray/data", "src/root/x"]
)
def test_the_search_for_machine_folders_spares_the_rest(line: str) -> None:
    assert not MACHINE_PATH.search(line)


def test_no_committed_file_is_large() -> None:
    # Lock files and the description of the service are generated.
    files = [p for p in committed() if p.suffix != ".lock" and p.name != "openapi.json"]
    large = [str(p.relative_to(ROOT)) for p in files if p.stat().st_size > 300_000]
    assert large == []


def requirements(lock: str) -> dict[str, list[str]]:
    """The packages of a lock file, by their normalised name, each with the lines below it."""
    results: dict[str, list[str]] = {}
    below: list[str] = []
    for line in (ROOT / lock).read_text().splitlines():
        if line.startswith("#") or not line.strip():
            continue
        if not line.startswith(" "):
            below = results.setdefault(normal(line), [])
        below.append(line)
    return results


def normal(requirement: str) -> str:
    """The name in a requirement, as the packaging standards compare names."""
    name = re.match(r"[A-Za-z0-9._-]+", requirement)
    assert name is not None, requirement
    return re.sub(r"[-_.]+", "-", name[0]).lower()


@pytest.mark.parametrize("lock", LOCKS)
def test_every_package_of_a_lock_file_is_pinned_with_a_hash_and_no_address(lock: str) -> None:
    for name, lines in requirements(lock).items():
        assert "==" in lines[0], f"{name} is not pinned"
        assert any("--hash=sha256:" in line for line in lines), f"{name} has no hash"
    assert "://" not in (ROOT / lock).read_text()


@pytest.mark.parametrize(("lock", "extras"), LOCKS.items())
def test_lock_files_cover_pyproject(lock: str, extras: tuple[str, ...]) -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    asked = [
        *project["dependencies"],
        *(one for extra in extras for one in project["optional-dependencies"][extra]),
    ]
    assert {normal(request) for request in asked} - set(requirements(lock)) == set()


def test_the_reference_gives_the_reason_of_every_dependency() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    table = re.findall(
        r"^\| `([\w-]+)` \| (.+) \|$", (ROOT / "docs/reference/dependencies.md").read_text(), re.M
    )
    assert [name for name, _ in table] == sorted(normal(asked) for asked in project["dependencies"])


def test_all_lock_files_pin_the_same_versions() -> None:
    # Behind the version stands for which platforms it is, which may be more of them for the tests.
    plain, *others = (
        {name: lines[0].partition(" ")[0] for name, lines in requirements(lock).items()} for lock in LOCKS
    )
    for other in others:
        assert {name: version for name, version in plain.items() if other[name] != version} == {}
