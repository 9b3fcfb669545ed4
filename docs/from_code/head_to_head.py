"""Table and code of the head-to-head page: recorded rows, and the functions that made them."""

import ast
import json
from collections.abc import Sequence
from pathlib import Path

from .tables import table

BENCHMARKS = Path(__file__).resolve().parents[2] / "benchmarks"
ROWS = BENCHMARKS / "results" / "head_to_head.json"
FIGURES = {"rms error": "rms error, m/s", "processor seconds": "processor seconds", "seconds": "seconds"}
CONSTANT = "best constant"

# Title, file in benchmarks/reconstruction, names shown of it, and whether they show without a click.
CODE = (
    (
        "What was called",
        "head_to_head.py",
        "PYGIMLI_ERROR_S times straight_cgls pygimli deepwave bentray_image on_square",
        True,
    ),
    (
        "Straight CGLS",
        "_straight_ray_peers.py",
        "SAMPLES CGLS_ROUGHNESS CGLS_STEPS straight_matrix _fan roughness _differences cgls",
        False,
    ),
    (
        "pyGIMLi",
        "_tomography_peers.py",
        "SPEED_BOUNDS_MPS PYGIMLI_COARSE PYGIMLI_SECONDARY_NODES PYGIMLI_STRENGTH_A_PAIR pygimli _on_nodes",
        False,
    ),
    (
        "deepwave",
        "_deepwave_peer.py",
        "BANDS CELLS SLOW_MPS RIM SCALE_MPS full_waveforms invert_band simulation ricker matched",
        False,
    ),
)


def head_to_head(file: Path = ROWS) -> str:
    """A row for each method, the least of each column bold; the best constant last."""
    recorded = json.loads(file.read_text())
    measured = [row for row in recorded if "figures" in row]
    least = {name: min(row["figures"][name] for row in measured) for name in FIGURES}
    rows = []
    for row in measured:
        figures = [_text(name, row["figures"][name], least[name]) for name in FIGURES]
        rows.append((_method(row), *figures))
    rows += [(_method(row), row["detail"], "", "") for row in recorded if row["value"] is None]
    constants = {row["baselines"][CONSTANT] for row in measured}
    rows += [(CONSTANT, f"{constant:.1f}", "", "") for constant in constants]
    return table(("method", *FIGURES.values()), rows)


def _method(row: dict) -> str:
    return row["target"].removeprefix("H1 ").removesuffix(": rms error")


def _text(name: str, value: float, least: float) -> str:
    text = f"{value:.1f}" if name == "rms error" or value < 10.0 else f"{value:.0f}"
    return f"**{text}**" if value == least else text


def head_to_head_code() -> str:
    """The source of each method, as it stands in its file."""
    return "\n\n".join(_block(*each) for each in CODE)


def _block(title: str, name: str, shown: str, opened: bool) -> str:
    path = f"benchmarks/reconstruction/{name}"
    code = "\n\n\n".join(definitions((BENCHMARKS / "reconstruction" / name).read_text(), shown.split()))
    block = f"<!-- not run: part of {path} -->\n```python\n{code}\n```"
    if opened:
        return block
    return f"<details>\n<summary>{title}: <code>{path}</code></summary>\n\n{block}\n\n</details>"


def definitions(text: str, names: Sequence[str]) -> list[str]:
    """The text of named functions and constants of a module, in its order, with the comments above them.

    Raises:
        KeyError: with the names that the module does not define.
    """
    lines, found = text.splitlines(), {}
    for node in ast.parse(text).body:
        targets = node.targets if isinstance(node, ast.Assign) else []
        defined = {part.id for target in targets for part in ast.walk(target) if isinstance(part, ast.Name)}
        defined |= {node.name} if isinstance(node, ast.FunctionDef) else set()
        first = node.lineno - 1
        while first and lines[first - 1].startswith("#"):
            first -= 1
        source = "\n".join(lines[first : node.end_lineno])
        found |= dict.fromkeys(defined & set(names), source)
    if absent := set(names) - set(found):
        raise KeyError(f"{', '.join(sorted(absent))}: not defined")
    return list(found.values())
