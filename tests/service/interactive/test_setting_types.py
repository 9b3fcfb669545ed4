"""Settings as types: names and values of the records, and errors of a type checker for wrong ones."""

from __future__ import annotations

import re
import subprocess
import sys
from dataclasses import fields
from pathlib import Path
from typing import Any, get_type_hints

import pytest

from bentray_kernels.tomography.settings import PLACES, Settings
from bentray_service.interactive import setting_types
from bentray_workers.rendering.refraction_view import RefractionView
from bentray_workers.simulation.request import PhantomScan

ROOT = Path(__file__).resolve().parents[3]
CODE = """
import bentray

scan = bentray.simulate("table7", nodes=32, three_d=True)
bentray.reconstruct(scan, "sart", rays="straight", relaxation=0.2, iterations=2)
bentray.reconstruct(scan, itertions=2)  # wrong: Unexpected keyword argument "itertions"
bentray.reconstruct(scan, rays="strait")  # wrong: incompatible type "Literal['strait']"
bentray.reconstruct(scan, "gauss")  # wrong: incompatible type "Literal['gauss']"
bentray.reconstruct(scan, nodes="many")  # wrong: incompatible type "str"
bentray.simulate(elemnts=16)  # wrong: Unexpected keyword argument "elemnts"
bentray.simulate("table8")  # wrong: incompatible type "Literal['table8']"

client = bentray.Client("http://127.0.0.1:8000", "key", patience_s=0.0)
client.submit("ds-1", method="sart", relaxation=0.2)
client.submit("ds-1", relaxtion=0.2)  # wrong: Unexpected keyword argument "relaxtion"
client.reconstruct(scan, rays="strait")  # wrong: incompatible type "Literal['strait']"
client.refraction_png("vol-1", widht=64)  # wrong: Unexpected keyword argument "widht"
client.datsets()  # wrong: has no attribute "datsets"
bentray.Client("http://127.0.0.1:8000", patience=0.0)  # wrong: Unexpected keyword argument "patience"


async def main() -> None:
    async with bentray.AsyncClient("http://127.0.0.1:8000") as client:
        await client.submit("ds-1", relaxation=0.2)
        await client.submit("ds-1", relaxtion=0.2)  # wrong: Unexpected keyword argument "relaxtion"
"""


def of_settings() -> dict[str, Any]:
    hints = {}
    for name, place in PLACES.items():
        record, _, leaf = place.rpartition(".")
        hints[name] = get_type_hints(type(getattr(Settings(), record)) if record else Settings)[leaf]
    return hints


def of_record(kind: type[Any]) -> dict[str, Any]:
    hints = get_type_hints(kind)
    return {one.name: hints[one.name] for one in fields(kind)}


@pytest.mark.parametrize(
    ("types", "record", "positional"),
    [
        (setting_types.ReconstructionSettings, of_settings(), {"method": setting_types.Method}),
        (setting_types.SimulationSettings, of_record(PhantomScan), {"phantom": setting_types.PhantomName}),
        (setting_types.RefractionSettings, of_record(RefractionView), {}),
    ],
    ids=["reconstruction", "simulation", "refraction"],
)
def test_types_are_those_of_the_records(
    types: type[Any], record: dict[str, Any], positional: dict[str, Any]
) -> None:
    assert get_type_hints(types) | positional == record


def test_a_type_checker_finds_wrong_names_and_values(tmp_path: Path) -> None:
    package = ROOT / "service" / "bentray_service"
    (tmp_path / "session.py").write_text(CODE)
    # Other modules are not followed: their imports take a minute to check.
    interactive = ("setting_types", "reconstruction", "simulation")
    modules = [str(package / "interactive" / f"{name}.py") for name in interactive]
    modules += map(str, sorted((package / "client").glob("*.py")))
    done = subprocess.run(
        [
            *(
                sys.executable,
                "-m",
                "mypy",
                "--follow-imports=skip",
                "--ignore-missing-imports",
                "--no-error-summary",
            ),
            *("--config-file=", f"--cache-dir={tmp_path / 'cache'}", "--explicit-package-bases"),
            *(str(ROOT / "service" / "bentray" / "__init__.py"), *modules, "session.py"),
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
