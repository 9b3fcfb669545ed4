"""The package ``bentray``: a light import, and names that are what they are inside."""

from __future__ import annotations

import subprocess
import sys
import types

import pytest

import bentray

HEAVY = "PIL dask distributed fastapi h5py httpx matplotlib numba numpy pydantic rich scipy sqlalchemy"


def loaded(code: str) -> set[str]:
    """The heavy modules that are loaded after some code in a new process."""
    code = f"import sys, bentray\n{code}\nprint(*sorted(set({HEAVY.split()!r}) & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return set(done.stdout.split())


def test_the_import_loads_nothing_and_a_client_no_kernels() -> None:
    assert loaded("") == set()
    assert "numpy" in loaded("bentray.read")
    light = loaded("bentray.Client; bentray.reconstruct; bentray.Result")
    assert light & {"dask", "distributed", "fastapi", "matplotlib", "numba"} == set()


def test_every_name_is_there_and_listed() -> None:
    assert dir(bentray) == sorted(bentray.__all__)
    for name in bentray.__all__:
        assert getattr(bentray, name) is not None
    public = {name for name, member in vars(bentray).items() if not name.startswith("_")}
    assert {name for name in public - {"TYPE_CHECKING", "PLACES"} if name not in bentray.__all__} == set()
    assert all(not isinstance(getattr(bentray, name), types.ModuleType) for name in bentray.__all__)


def test_an_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="module 'bentray' has no attribute 'recontruct'"):
        _ = bentray.recontruct
