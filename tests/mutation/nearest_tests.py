"""The numerical modules, and the test files nearest to each of them."""

from __future__ import annotations

import re
from pathlib import Path

PACKAGE, TESTS = Path("kernels/bentray_kernels"), Path("tests/kernels")

# Folders of numerics; the others check arguments, describe devices or draw test objects.
FOLDERS = (
    "acquisition",
    "eikonal",
    "geometry_field",
    "isosurface",
    "meshes",
    "rays",
    "refraction",
    "splines",
    "tomography",
    "wave",
)

# Files without numerics: names, requests, messages, plans, stored states, estimates of cost and memory. Files
# for devices are left out because their loops are OpenCL sources.
OTHER = re.compile(
    r"(__init__|registry|\w*settings|requirements|rules|finding|pickers|\w*checkpoint|\w*_graphs?|dataset"
    r"|emissions|waveform|memory|memory_\w+|device_\w+|vector_width|waveform_cost|result|solver_choice|candidates|numerics"
    r"|decomposition|geometry_summary|examination|\w*_opencl|finite_frequency_candidates|reconstruction"
    r"|inversion_state|time_blocks|image_grid|problem|packed_scene|scene|defects|example_surfaces)\.py"
)
# Excluded by their names above, but numerics.
NUMERICS = {"eikonal/problem.py", "tomography/problem.py", "acquisition/waveform.py"}


def modules(root: Path) -> list[str]:
    """Paths of the numerical modules below the package, in alphabetical order."""
    found = []
    for folder in FOLDERS:
        for path in (root / PACKAGE / folder).rglob("*.py"):
            name = path.relative_to(root / PACKAGE).as_posix()
            if name in NUMERICS or not OTHER.fullmatch(path.name):
                found.append(name)
    return sorted(found)


def near(root: Path, module: str) -> list[str]:
    """Test files of a module: the mirrored one and those of its folder that import it.

    Without either all of the folder.
    """
    path = Path(module)
    folder = root / TESTS / path.parent
    mirror = folder / f"test_{path.stem}.py"
    others = sorted(one for one in folder.glob("test_*.py") if one != mirror)
    imports = re.compile(rf"\bimport [^\n]*\b{path.stem}\b|\b{path.stem} import ")
    found = [one for one in others if imports.search(one.read_text(encoding="utf-8"))]
    found = [mirror, *found] if mirror.is_file() else found or others
    return [one.relative_to(root).as_posix() for one in found]


def wide(root: Path, module: str) -> list[str]:
    """All other test files of the part of the kernels to which a module belongs, its own folder first."""
    folder = TESTS / Path(module).parent
    done = set(near(root, module))
    every = (one.relative_to(root) for one in (root / TESTS / Path(module).parts[0]).rglob("test_*.py"))
    ordered = sorted(every, key=lambda one: (one.parent != folder, one))
    return [name for one in ordered if (name := one.as_posix()) not in done]
