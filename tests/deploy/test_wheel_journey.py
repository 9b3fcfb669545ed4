"""The wheel in an empty environment outside the repository: demo, session, service, pages, client."""

import json
import os
import shutil
import signal
import subprocess
import sys
import urllib.request
from collections.abc import Iterator
from pathlib import Path

import pytest

from .programs import ROOT, run

PAGES = ("/", "/docs", "/documentation/", "/openapi.json")
SESSION = """
import sys, bentray
assert bentray.__file__.startswith(sys.prefix), bentray.__file__
scan = bentray.simulate(elements=32, nodes=32, progress=False)
image = bentray.reconstruct(scan, "sart", nodes=32, iterations=1, progress=False)
image.save("speed.nii.gz")
image.save("speed.h5")
print(image.compare().rms)
"""
CLIENT = """
import sys, bentray
with bentray.Client(sys.argv[1]) as client:
    scan = bentray.simulate(elements=32, nodes=32, progress=False)
    scan.save("scan.h5")
    job = client.submit(client.upload("scan.h5").id, {"method": "sart", "nodes": 32, "iterations": 1})
    print(client.wait(job.id).state)
"""

pytestmark = pytest.mark.nightly


class Environment:
    """A virtual environment with the locked packages and the wheel, and an empty home folder."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.home, self.programs = folder, folder / "home", folder / "env" / "bin"
        self.home.mkdir()
        kept = {
            name: value for name, value in os.environ.items() if name.startswith(("PIP_", "LANG", "SSL_"))
        }
        self.variables = {**kept, "HOME": str(self.home), "PATH": f"{self.programs}:/usr/bin:/bin"}

    def run(self, program: str, *words: str) -> str:
        command = (str(self.programs / program), *words)
        return run(*command, folder=self.home, variables=self.variables)


@pytest.fixture(scope="module")
def installed(dist: Path, tmp_path_factory: pytest.TempPathFactory) -> Environment:
    """Install by how-to/install-without-a-network.md, but from the package index."""
    folder = tmp_path_factory.mktemp("journey")
    (wheel,) = dist.glob("*.whl")
    shutil.copy(ROOT / "requirements.lock", folder)
    subprocess.run([sys.executable, "-m", "venv", str(folder / "env")], check=True)
    environment = Environment(folder)
    environment.run("pip", "install", "-q", "--require-hashes", "-r", str(folder / "requirements.lock"))
    environment.run("pip", "install", "-q", "--no-deps", str(wheel))
    return environment


@pytest.fixture(scope="module")
def url(installed: Environment) -> Iterator[str]:
    """Address of a service that listens on a free port, from the line that it prints."""
    command = [str(installed.programs / "bentray"), "serve", "--port", "0", "--workers", "1"]
    data = installed.home / "data"
    service = subprocess.Popen(
        [*command, "--data", str(data), "--json"],
        cwd=installed.home,
        env=installed.variables,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert service.stdout is not None
    try:
        yield json.loads(service.stdout.readline())["url"]
    finally:
        service.send_signal(signal.SIGTERM)
        code = service.wait(60)
    assert code in (0, -signal.SIGTERM), code


def test_the_demo_gets_a_better_image_along_bent_rays(installed: Environment) -> None:
    record = json.loads(installed.run("bentray", "demo", "--nodes", "48", "--elements", "64", "--json"))[
        "jobs"
    ]
    straight, bent = (record[name]["truth"]["mean_absolute_error_of_range"] for name in ("straight", "bent"))
    assert bent < straight < 0.2


def test_a_session_reconstructs_and_saves(installed: Environment) -> None:
    assert float(installed.run("python", "-c", SESSION)) > 0.0
    assert (installed.home / "speed.nii.gz").stat().st_size > 1000


def test_every_page_is_served(url: str) -> None:
    for page in PAGES:
        with urllib.request.urlopen(url.rstrip("/") + page, timeout=60) as answer:
            assert answer.status == 200, page
            assert answer.read(), page


def test_the_client_gets_an_image(installed: Environment, url: str) -> None:
    assert installed.run("python", "-c", CLIENT, url).split() == ["succeeded"]
