"""Digests change with what a module imports, at any distance, and with nothing else."""

import shutil
from pathlib import Path

import pytest

from bentray_kernels import sources


@pytest.fixture
def package(tmp_path, monkeypatch):
    root = tmp_path / "bentray_kernels"
    for path in sources.ROOT.rglob("*.py"):
        target = root / path.relative_to(sources.ROOT)
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(path, target)
    monkeypatch.setattr(sources, "ROOT", root)

    def digest(module):
        sources.digest.cache_clear()
        sources._imported.cache_clear()
        return sources.digest(f"bentray_kernels.{module}")

    yield root, digest
    sources.digest.cache_clear()
    sources._imported.cache_clear()


def edited(root: Path, module: str):
    path = root / f"{module.replace('.', '/')}.py"
    path.write_text(path.read_text() + "\n# edited\n")


@pytest.mark.parametrize("module", ["rays.descent", "eikonal.heap", "eikonal.updates", "tomography.huber"])
def test_an_edit_below_is_noticed(package, module):
    root, digest = package
    before = digest("tomography"), digest("splines.lanes")
    edited(root, module)
    assert digest("tomography") != before[0]
    assert digest("splines.lanes") == before[1]


def test_each_import_of_the_package_is_followed(package):
    root, digest = package
    (root / "one.py").write_text("from .two import (\n    three,\n    four,\n)\n")
    (root / "two").mkdir()
    (root / "two" / "__init__.py").write_text("from . import three, five as six\n")
    (root / "two" / "three.py").write_text("")
    (root / "two" / "five.py").write_text("def late():\n    from ..seven import eight\n")
    (root / "seven.py").write_text("")
    (root / "nine.py").write_text("")
    before = digest("one")
    for module, matters in (("two.three", True), ("two.five", True), ("seven", True), ("nine", False)):
        edited(root, module)
        assert (digest("one") != before) is matters
        before = digest("one")


def test_a_kernel_from_elsewhere_may_use_all(package):
    root, _ = package
    before = sources.digest("somewhere.else")
    edited(root, "splines.lanes")
    sources.digest.cache_clear()
    assert sources.digest("somewhere.else") != before
