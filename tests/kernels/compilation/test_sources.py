"""Source digests change with the code that a module imports, directly or not, and with nothing else."""

import shutil
from pathlib import Path

import pytest

from bentray_kernels.compilation import sources


@pytest.fixture
def package(tmp_path, monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "cache"))
    sources._memory.cache_clear()
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
    sources._memory.cache_clear()


def edited(root: Path, module: str):
    path = root / f"{module.replace('.', '/')}.py"
    path.write_text(path.read_text() + "\nedited = True\n")


@pytest.mark.parametrize(
    "module", ["rays.descent", "eikonal.heap", "eikonal.updates", "tomography.gauss_newton.huber"]
)
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


def test_comments_docstrings_and_layout_do_not_matter(package):
    root, digest = package
    path = root / "splines" / "prefilter.py"
    before = digest("splines.prefilter")
    text = path.read_text()
    path.write_text(text.replace('"""', '"""Now in other words. ', 1) + "\n\n# A remark.\n")
    assert digest("splines.prefilter") == before
    path.write_text(text.replace("def ", "def other_", 1))
    assert digest("splines.prefilter") != before


def test_cached_result_equals_the_parsed_one(package, tmp_path):
    _, digest = package
    parsed = digest("eikonal.updates")
    memory = tmp_path / "cache" / sources.MEMORY
    assert memory.exists()
    sources._memory.cache_clear()
    assert digest("eikonal.updates") == parsed
    memory.write_text("no JSON")
    sources._memory.cache_clear()
    assert digest("eikonal.updates") == parsed
    assert list(memory.parent.iterdir()) == [memory]
