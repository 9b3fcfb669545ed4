"""Code of the head-to-head page: the functions that its benchmark runs, from their files."""

from __future__ import annotations

import ast
from collections.abc import Sequence
from pathlib import Path

BENCHMARKS = Path(__file__).resolve().parents[2] / "benchmarks"

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
        "SPEED_BOUNDS_MPS PYGIMLI_AREA PYGIMLI_SECONDARY_NODES PYGIMLI_STRENGTH_A_PAIR pygimli _on_nodes",
        False,
    ),
    (
        "deepwave",
        "_deepwave_peer.py",
        "BANDS CELLS SLOW_MPS RIM SCALE_MPS full_waveforms invert_band simulation ricker matched",
        False,
    ),
)


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
