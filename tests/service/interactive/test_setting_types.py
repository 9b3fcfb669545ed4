"""Settings as types: names and values of the records, and errors of a type checker for wrong ones."""

import re
import subprocess
import sys
from pathlib import Path

from bentray_kernels.tomography.settings import PLACES, Settings
from bentray_service.interactive.setting_stubs import STUBS, stubs, types_of

ROOT = Path(__file__).resolve().parents[3]
CODE = """
import bentray

scan = bentray.simulate("table7", nodes=32, three_d=True)
bentray.reconstruct(scan, "sart", rays="straight", penalty_strength=0.2, iterations=2)
bentray.reconstruct(scan, itertions=2)  # wrong: Unexpected keyword argument "itertions"
bentray.reconstruct(scan, rays="strait")  # wrong: incompatible type "Literal['strait']"
bentray.reconstruct(scan, "gauss")  # wrong: incompatible type "Literal['gauss']"
bentray.reconstruct(scan, nodes="many")  # wrong: incompatible type "str"
bentray.simulate(elemnts=16)  # wrong: Unexpected keyword argument "elemnts"
bentray.simulate("table8")  # wrong: incompatible type "Literal['table8']"

client = bentray.Client("http://127.0.0.1:8000", "key", patience_s=0.0)
client.submit("ds-1", method="sart", penalty_strength=0.2)
client.submit("ds-1", penaltie=0.2)  # wrong: Unexpected keyword argument "penaltie"
client.reconstruct(scan, rays="strait")  # wrong: incompatible type "Literal['strait']"
client.refraction_png("vol-1", widht=64)  # wrong: Unexpected keyword argument "widht"
client.datsets()  # wrong: has no attribute "datsets"
bentray.Client("http://127.0.0.1:8000", patience=0.0)  # wrong: Unexpected keyword argument "patience"


async def main() -> None:
    async with bentray.AsyncClient("http://127.0.0.1:8000") as client:
        await client.submit("ds-1", penalty_strength=0.2)
        await client.submit("ds-1", penaltie=0.2)  # wrong: Unexpected keyword argument "penaltie"
"""


def test_types_are_those_of_the_records() -> None:
    advice = "run: python -m bentray_service.interactive.setting_stubs"
    assert STUBS.read_text(encoding="utf-8") == stubs(), advice
    assert types_of(Settings).keys() == PLACES.keys()


def test_a_type_checker_finds_wrong_names_and_values(tmp_path: Path) -> None:
    package = ROOT / "service" / "bentray_service"
    (tmp_path / "session.py").write_text(CODE)
    # Other modules are not followed: their imports take a minute to check.
    interactive = ("setting_types.pyi", "reconstruction.py")
    modules = [str(package / "interactive" / name) for name in interactive]
    modules += map(str, sorted((package / "client").glob("*.py")))
    options = "--follow-imports=skip --ignore-missing-imports --no-error-summary --config-file="
    done = subprocess.run(
        [
            *(sys.executable, "-m", "mypy", *options.split(), "--explicit-package-bases"),
            *(f"--cache-dir={tmp_path / 'cache'}", str(ROOT / "service" / "bentray" / "__init__.py")),
            *(*modules, "session.py"),
        ],
        cwd=tmp_path,
        env={"MYPYPATH": str(ROOT / "service"), "PATH": ""},
        capture_output=True,
        text=True,
        check=False,
    )
    found = dict(re.findall(r"^session\.py:(\d+): error: (.*?)  \[", done.stdout, re.MULTILINE))
    wrong = {
        str(number): line.partition("# wrong: ")[2]
        for number, line in enumerate(CODE.splitlines(), 1)
        if "# wrong: " in line
    }
    assert found.keys() == wrong.keys(), done.stdout + done.stderr
    for number, words in wrong.items():
        assert words in found[number]
