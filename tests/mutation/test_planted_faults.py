"""Planted faults: each changes the syntax tree once, and the tests of a copy find one that matters."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

from .nearest_tests import PACKAGE, modules, near, wide
from .planted_faults import planted_faults
from .sampling import entry, key, sample

ROOT = Path(__file__).resolve().parents[2]

SOURCE = '''"""Doc 1."""
LIMIT: Literal[3] = 0.5
@kernel(inline="always")
def f(x: int, más=2) -> float:
    "-1"
    if x < 0:
        raise InvalidInput("x", x, ">= 0")
    y = "ñ" if x else -x  # a + b
    y += max(x - 1.0, LIMIT) ** 2
    return y if 0.0 < y <= x and not más else (y) * (
        x
    )
'''


def test_each_kind_of_fault_is_planted_where_it_matters_and_nowhere_else():
    found = {(fault.kind, fault.function, fault.before, fault.after) for fault in planted_faults(SOURCE)}
    assert found == {
        ("constant", "", "LIMIT: Literal[3] = 0.5", "LIMIT: Literal[3] = 1.0"),
        ("constant", "f", "def f(x: int, más=2) -> float:", "def f(x: int, más=3) -> float:"),
        ("sign", "f", "-x", "(x)"),
        ("operator", "f", "y += max(x - 1.0, LIMIT) ** 2", "y -= max(x - 1.0, LIMIT) ** 2"),
        ("operator", "f", "max(x - 1.0, LIMIT) ** 2", "max(x - 1.0, LIMIT) * 2"),
        ("operator", "f", "x - 1.0", "x + 1.0"),
        ("bound", "f", "max(x - 1.0, LIMIT)", "(x - 1.0)"),
        ("bound", "f", "max(x - 1.0, LIMIT)", "(LIMIT)"),
        ("constant", "f", "y += max(x - 1.0, LIMIT) ** 2", "y += max(x - 2.0, LIMIT) ** 2"),
        ("constant", "f", "y += max(x - 1.0, LIMIT) ** 2", "y += max(x - 1.0, LIMIT) ** 3"),
        ("comparison", "f", "0.0 < y <= x", "0.0 > y <= x"),
        ("comparison", "f", "0.0 < y <= x", "0.0 < y >= x"),
        ("limit", "f", "0.0 < y <= x", "0.0 < y < x"),
        ("constant", "f", *(f"return y if {n} < y <= x and not más else (y) * (" for n in ("0.0", "1.0"))),
        ("logic", "f", "0.0 < y <= x and not más", "0.0 < y <= x or not más"),
        ("logic", "f", "not más", "(más)"),
        ("operator", "f", "(y) * ( x )", "(y) / ( x )"),
    }


def test_a_fault_changes_the_tree_and_nothing_before_or_behind_it():
    whole = ast.dump(ast.parse(SOURCE))
    for fault in planted_faults(SOURCE):
        damaged = fault.planted(SOURCE)
        assert ast.dump(ast.parse(damaged)) != whole
        assert damaged[: fault.begin] == SOURCE[: fault.begin]
        assert damaged.endswith(SOURCE[fault.end :])


def test_a_sample_covers_all_modules_before_it_repeats_one():
    names = modules(ROOT)
    drawn = sample(ROOT, len(names), 3)
    assert sorted(module for module, _ in drawn) == names
    assert drawn[:20] == sample(ROOT, 20, 3)
    assert drawn != sample(ROOT, len(names), 4)
    assert len({key(entry(*one)) for one in drawn}) == len(names)
    for module, fault in drawn[:20]:
        assert fault.before != fault.after, module


@pytest.mark.parametrize(
    ("module", "first"),
    [
        ("wave/stencil.py", "tests/kernels/wave/test_stencil.py"),
        ("acquisition/picking/differential.py", "tests/kernels/acquisition/picking/test_onset.py"),
    ],
)
def test_every_module_has_tests_and_the_mirrored_file_comes_first(module, first):
    assert (ROOT / PACKAGE / module).is_file()
    assert near(ROOT, module)[0] == first
    assert not set(near(ROOT, module)) & set(wide(ROOT, module))
    assert all(near(ROOT, one) for one in modules(ROOT))
