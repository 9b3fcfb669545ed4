"""The package ``bentray``: a light import, and names that are what they are inside."""

from __future__ import annotations

import subprocess
import sys
import types

import pytest

import bentray

HEAVY = "PIL dask distributed fastapi h5py httpx matplotlib numba numpy pydantic rich scipy sqlalchemy"


def loaded(code: str) -> set[str]:
    """The packages that are loaded after some code in a new process."""
    code = f"import sys\n{code}\nprint(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return {name.partition(".")[0] for name in done.stdout.split()}


@pytest.mark.parametrize(
    ("code", "absent"),
    [
        ("import bentray", HEAVY),
        (
            "import bentray; bentray.Client; bentray.reconstruct; bentray.Result",
            "dask distributed fastapi matplotlib numba",
        ),
        (
            "import bentray_service.cli",
            "numpy numba dask distributed fastapi h5py sqlalchemy matplotlib httpx",
        ),
        ("import bentray_service.healthcheck", "numpy dask distributed httpx pydantic fastapi typer"),
        ("import bentray_kernels.tomography.requirements", "numba scipy distributed"),
        ("import bentray_workers.cluster.connection", "dask_jobqueue dask_kubernetes"),
    ],
)
def test_imports_are_light(code: str, absent: str) -> None:
    assert loaded(code) & set(absent.split()) == set()


def test_a_name_loads_what_it_needs() -> None:
    assert "numpy" in loaded("import bentray; bentray.read")


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
