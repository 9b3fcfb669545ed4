"""Compiled kernels: one compilation for all numbers, cached by the content of all sources."""

import pickle
import sys
from pathlib import Path

import pytest

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
