"""Types of the settings of jobs, for editors; ``python -m bentray_service.interactive.setting_stubs``."""

from __future__ import annotations

from dataclasses import Field, fields, is_dataclass
from pathlib import Path
from typing import Any

from bentray_kernels.tomography.settings import Settings
from bentray_workers.rendering.refraction_view import RefractionView
from bentray_workers.simulation.request import PhantomScan

# A stub alone: nothing needs these types as the program runs.
STUBS = Path(__file__).with_name("setting_types.pyi")
HEAD = '''"""The settings of jobs as types, for editors and type checkers; written by ``setting_stubs``."""

from typing import Literal, TypedDict

from bentray_kernels.requests.names import DeviceRequest, PickerName, SolverName, UpAxis
'''


def stubs() -> str:
    """The content of the stub: one ``TypedDict`` for each kind of job."""
    settings, phantom = types_of(Settings), types_of(PhantomScan)
    lines = [HEAD, f"Method = {settings.pop('method')}", f"PhantomName = {phantom.pop('phantom')}"]
    named = {
        "ReconstructionSettings": settings,
        "SimulationSettings": phantom,
        "RefractionSettings": types_of(RefractionView),
    }
    for name, types in named.items():
        lines += [
            "",
            f"class {name}(TypedDict, total=False):",
            *(f"    {key}: {hint}" for key, hint in types.items()),
        ]
    return "\n".join(lines) + "\n"


def types_of(kind: type[Any]) -> dict[str, str]:
    """The types of the settings of a record and those in it, as source, each by its own name."""
    types: dict[str, str] = {}
    for row in fields(kind):
        if is_dataclass(row.default):
            inner = types_of(type(row.default))
            types |= {row.name if name == "enabled" else name: hint for name, hint in inner.items()}
        else:
            types[row.name] = _source(row)
    return types


def _source(row: Field[Any]) -> str:
    return str(row.type).replace("'", '"')


if __name__ == "__main__":
    STUBS.write_text(stubs(), encoding="utf-8")
