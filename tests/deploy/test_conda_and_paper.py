"""The conda-forge recipe has the dependencies of pyproject.toml; the paper has its sources and figures."""

import json
import re
import tomllib
from pathlib import Path
from typing import Any

import yaml

ROOT = Path(__file__).resolve().parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
RECIPE: dict[str, Any] = yaml.safe_load((ROOT / "deploy" / "conda" / "recipe.yaml").read_text())
PAPER = (ROOT / "paper" / "paper.md").read_text()
# Other names on conda-forge, or there without parts that are not needed.
CONDA_NAMES = {
    "dask": "dask-core",
    "matplotlib": "matplotlib-base",
    "prometheus-client": "prometheus_client",
    "pocl-binary-distribution": "pocl",
}


def test_the_recipe_has_the_dependencies_and_the_version() -> None:
    wanted = {}
    for one in PROJECT["dependencies"]:
        name, bound = re.fullmatch(r"([\w.-]+)(?:\[\w+\])?>=([\d.]+).*", one).groups()  # type: ignore[union-attr]
        wanted[CONDA_NAMES.get(name, name)] = bound
    found = dict(
        re.fullmatch(r"(\S+)(?: >=(\S+))?", one).groups()  # type: ignore[union-attr]
        for one in RECIPE["requirements"]["run"]
        if not one.startswith(("__", "python "))
    )
    # The version of the driver in the package index is not that of PoCL on conda-forge.
    assert found.pop("pocl") is None
    wanted.pop("pocl")
    assert found == wanted
    assert RECIPE["context"]["version"] == PROJECT["version"]
    assert PROJECT["requires-python"] == f">={RECIPE['context']['python_min']}"
    (script,) = RECIPE["build"]["python"]["entry_points"]
    assert script == f"bentray = {PROJECT['scripts']['bentray']}"


def test_the_paper_has_its_sources_and_pictures() -> None:
    cited = set(re.findall(r"-?@([a-z]+\d{4})", PAPER))
    known = set(re.findall(r"^@\w+\{(\w+),", (ROOT / "paper" / "paper.bib").read_text(), re.MULTILINE))
    assert cited == known
    pictures = re.findall(r"\]\(([^)]+\.png)\)", PAPER)
    assert len(pictures) >= 2
    for picture in pictures:
        assert (ROOT / "paper" / picture).is_file(), picture


def test_the_scoreboard_of_the_paper_is_the_recorded_one() -> None:
    recorded = json.loads((ROOT / "benchmarks" / "results" / "scoreboard.json").read_text())
    rows = {row["target"]: row for row in recorded}
    shown = re.findall(r"^\| (\w+) \| ([\d.]+) \| ([\d.]+) \| ([\d.]+) \| ([\d.]+) \|$", PAPER, re.MULTILINE)
    assert len(shown) == 4
    for breast, *values in shown:
        auto, waveform = rows[f"{breast}, auto: RMSE"], rows[f"{breast}, waveform: RMSE"]
        others = auto["baselines"]["best constant"], auto["baselines"]["straight rays"]
        assert values == [f"{one:.1f}" for one in (*others, auto["value"], waveform["value"])], breast
