"""The release: complete packages that work without the repository, and a bill of materials."""

import json
import os
import re
import shutil
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from pathlib import Path
from typing import Any

import pytest
import yaml

from . import programs
from .conftest import RELEASED
from .programs import ROOT

PYPROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())
PROJECT = PYPROJECT["project"]
# In the wheel.
DOCUMENTATION = "bentray_service/web/built_documentation/"
WRITTEN = "bentray_service/web/written_documentation/"
PACKAGES = PYPROJECT["tool"]["hatch"]["build"]["targets"]["wheel"]["packages"]
# Of the service; what they answer is in the wheel.
ADDRESSES = ("/", "/docs", "/documentation/", "/static/app.js", "/openapi.json")


def run(*command: str, folder: Path) -> str:
    """The output of Python in a folder, at the time of a release."""
    return programs.run(sys.executable, *command, folder=folder, variables=os.environ | RELEASED)


def only(folder: Path, pattern: str) -> Path:
    (result,) = folder.glob(pattern)
    return result


def test_the_wheel_holds_the_packages_and_nothing_else(dist: Path) -> None:
    listed = subprocess.run(
        ["git", "ls-files", "-z", *PACKAGES], cwd=ROOT, capture_output=True, text=True, check=True
    )
    committed = {name.partition("/")[2] for name in listed.stdout.split("\0") if (ROOT / name).is_file()}
    packed = set(zipfile.ZipFile(only(dist, "*.whl")).namelist())
    pages = {DOCUMENTATION + name for name in ("index.html", "_static/pages.css")}
    assert {name for name in packed if ".dist-info/" not in name} == committed | pages
    assert any(name.endswith(".dist-info/licenses/LICENSE") for name in packed)


def test_the_source_distribution_gives_the_same_wheel(dist: Path, tmp_path: Path) -> None:
    with tarfile.open(only(dist, "*.tar.gz")) as packed:
        packed.extractall(tmp_path, filter="data")
    source = only(tmp_path, "bentray-*")
    for name in ("Makefile", "tests", "docs", "deploy", "requirements.lock", "CITATION.cff", "SECURITY.md"):
        assert (source / name).exists(), name
    run("-m", "hatchling", "build", "-d", str(tmp_path / "again"), "-t", "wheel", folder=source)
    assert only(tmp_path / "again", "*.whl").read_bytes() == only(dist, "*.whl").read_bytes()


def test_the_files_in_the_image_give_the_same_wheel(dist: Path, tmp_path: Path) -> None:
    """A file that the build needs and the Dockerfile does not copy would stop the build of the image."""
    source, text = tmp_path / "build", (ROOT / "deploy" / "Dockerfile").read_text()
    for names, folder in re.findall(
        r"^COPY (?!--from|requirements|deploy/\w+\.sh)(.+) (\S+)$", text, re.MULTILINE
    ):
        for name in (name_of for name_of in names.split() if name_of != "buil[d]"):
            if (ROOT / name).is_dir():
                shutil.copytree(ROOT / name, source / folder, ignore=shutil.ignore_patterns("__pycache__"))
            else:
                (source / folder).mkdir(parents=True, exist_ok=True)
                shutil.copy(ROOT / name, source / folder)
    run("-m", "hatchling", "build", "-d", str(tmp_path / "dist"), "-t", "wheel", folder=source)
    here, there = (set(zipfile.ZipFile(only(one, "*.whl")).namelist()) for one in (dist, tmp_path / "dist"))
    pages = {name for name in there if name.startswith(WRITTEN)}
    assert {WRITTEN + name for name in ("index.md", "pictures/viewer.png", "recipes/02_own_data.py")} <= pages
    assert there - pages == {name for name in here if not name.startswith(DOCUMENTATION)}


def test_a_documentation_that_is_not_built_is_no_release(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "hatchling", "build", "-d", str(tmp_path / "dist"), "-t", "wheel"]
    named = os.environ | {"BENTRAY_DOCUMENTATION": str(tmp_path)}
    done = subprocess.run(command, cwd=ROOT, env=named, capture_output=True, text=True, check=False)
    assert done.returncode != 0
    assert "make docs" in done.stderr


@pytest.mark.nightly
def test_page_and_reference_are_served_from_the_wheel(dist: Path, tmp_path: Path) -> None:
    zipfile.ZipFile(only(dist, "*.whl")).extractall(tmp_path / "installed")
    code = f"""
import sys, warnings
warnings.simplefilter("ignore")
sys.path.insert(0, {str(tmp_path / "installed")!r})
import bentray, bentray_kernels, bentray_workers, bentray_service
from pathlib import Path
from fastapi.testclient import TestClient
from bentray_service.app import create_app
from bentray_service.settings import ServiceSettings
for package in (bentray, bentray_kernels, bentray_workers, bentray_service):
    assert Path(package.__file__).is_relative_to({str(tmp_path / "installed")!r}), package
app = TestClient(create_app(ServiceSettings(data_dir=Path("data"))), base_url="http://localhost")
for address in {ADDRESSES}:
    answer = app.get(address)
    print(address, answer.status_code, len(answer.content) > 1000)
print(bentray.__version__)
"""
    said = run("-c", code, folder=tmp_path).splitlines()
    assert said == [*(f"{address} 200 True" for address in ADDRESSES), PROJECT["version"]]


def test_the_bill_lists_every_locked_package() -> None:
    text = run("deploy/sbom.py", folder=ROOT)
    assert run("deploy/sbom.py", folder=ROOT) == text
    bill: dict[str, Any] = json.loads(text)
    assert (bill["bomFormat"], bill["specVersion"]) == ("CycloneDX", "1.6")
    assert bill["metadata"]["timestamp"] == "2026-01-01T00:00:00Z"
    assert bill["metadata"]["component"]["purl"] == f"pkg:pypi/bentray@{PROJECT['version']}"
    locked = re.findall(r"^([\w.-]+)==(\S+)", (ROOT / "requirements.lock").read_text(), re.MULTILINE)
    names = [(part["name"], part["version"]) for part in bill["components"]]
    assert names == [(re.sub(r"[-_.]+", "-", name).lower(), version) for name, version in locked]
    references = [part["bom-ref"] for part in bill["components"]]
    assert len(set(references)) == len(references)
    (direct,) = bill["dependencies"]
    # A lock for several versions of Python pins some packages twice.
    pinned = {re.fullmatch(r"pkg:pypi/(.+)@.+", ref)[1] for ref in direct["dependsOn"]}  # type: ignore[index]
    assert pinned == {re.split(r"[^A-Za-z0-9._-]", dep)[0].lower() for dep in PROJECT["dependencies"]}
    licensed = [part for part in bill["components"] if "licenses" in part]
    assert len(licensed) > 0.9 * len(names)


def test_the_citation_has_the_version_and_the_licence() -> None:
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    assert {"cff-version", "message", "title", "authors"} <= citation.keys()
    assert str(citation["version"]) == PROJECT["version"]
    assert citation["license"] == PROJECT["license"]
    assert f"version {PROJECT['version']}" in (ROOT / "README.md").read_text()
