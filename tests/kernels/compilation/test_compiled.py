"""Compiled kernels: one compilation for all numbers, cached by the content of all imported sources."""

import pickle
import shutil
import sys
from pathlib import Path

import pytest

from bentray_kernels.compilation import sources
from bentray_kernels.compilation.compiled import CacheLocator, kernel


@kernel(inline="always")
def double(x):
    return 2 * x


@kernel
def doubled(x):
    return double(x) + double(3)


def test_literal_numbers_are_compiled_as_any_others():
    assert doubled(2) == 10
    # Not as an earlier run has stored it.
    doubled.dispatcher.recompile()
    assert len(double.dispatcher.signatures) == 1


def test_an_inlined_kernel_can_be_called_from_python():
    assert double(2.5) == 5.0


def test_a_kernel_is_pickled_by_its_name():
    assert pickle.loads(pickle.dumps(doubled)) is doubled


def test_files_of_other_sources_are_removed_when_a_kernel_is_stored():
    locator = CacheLocator.from_function(doubled.py_func, __file__)
    version = "py{}{}".format(*sys.version_info)
    names = (
        f"test_compiled.doubled-{locator.get_disambiguator()}",
        "test_compiled.doubled-9-0123456789abcdef",
        "test_compiled.undoubled-9-0123456789abcdef",
        # A kernel of the same name, of another module beside it.
        "others.doubled-9-0123456789abcdef",
        "others.test_compiled.doubled-9-0123456789abcdef",
    )
    files = [Path(locator.get_cache_path(), f"{name}.{version}.nbi") for name in names]
    for file in files:
        file.parent.mkdir(parents=True, exist_ok=True)
        file.touch()
    locator.ensure_cache_path()
    assert [file.exists() for file in files] == [True, False, True, True, True]
    for file in files[2:]:
        file.unlink()


@pytest.mark.parametrize("function", [double, doubled])
def test_a_kernel_runs_where_the_disk_is_full(monkeypatch, function):
    def refuse(_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(CacheLocator, "ensure_cache_path", refuse)
    # Of a type that no other test stores.
    assert kernel(function.py_func)(2.5 + 1j) == 5.0 + 2j + (6.0 if function is doubled else 0.0)


def test_a_kernel_runs_where_nothing_can_be_cached():
    # Of no file, as on a system without any folder to write to.
    assert kernel(eval("lambda x: 2 * x"))(3) == 6


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
