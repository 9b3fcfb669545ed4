"""Mutation run: faults planted by Cosmic Ray one at a time, and which the nearest tests find.

``make mutants`` installs Cosmic Ray into an environment of its own and runs this on the numerics;
``ARGS="--part service"`` on the service, ``ARGS="--only rays"`` narrows it. It works in a checkout of the
last commit in ``build/mutants``, with a session of each module, so that a run can be ended at any time and
continues where it was.
"""

import argparse
import json
import random
import re
import shlex
import subprocess
import sys
from collections import Counter
from functools import cache
from pathlib import Path

from cosmic_ray.work_db import WorkDB  # type: ignore[import-not-found]
from cosmic_ray.work_item import WorkerOutcome, WorkResult  # type: ignore[import-not-found]

ROOT = Path(__file__).resolve().parents[1]
BUILD = ROOT / "build/mutants"
TREE = BUILD / "tree"

# Parts: package, tests, and names of faulted modules. Numerics are without names, settings, states, and loops
# that are OpenCL.
PARTS = {
    "kernels": (
        TREE / "kernels/bentray_kernels",
        TREE / "tests/kernels",
        r"(acquisition|eikonal|geometry_field|isosurface|meshes|rays|refraction|splines|tomography|wave)/(.+/)?"
        r"(?!__|(registry|dataset|result|\w*(settings|checkpoint|graphs?|_opencl)|device_\w+)\.py)\w+\.py",
    ),
    "service": (
        TREE / "service/bentray_service",
        TREE / "tests/service",
        r"(?!rows/alembic/)(.+/)?(?!__)\w+\.py",
    ),
}

# Faults that a careless edit makes; the other operators of Cosmic Ray do not even compile.
OPERATORS = re.compile(
    r"core/(ReplaceBinaryOperator_(Add_Sub|Sub_Add|Mul_Div|Div_Mul|Pow_Mul)"
    r"|ReplaceComparisonOperator_(Lt_LtE|LtE_Lt|Gt_GtE|GtE_Gt|Lt_Gt|Gt_Lt|Eq_NotEq|NotEq_Eq|Is_IsNot|IsNot_Is)"
    r"|ReplaceUnaryOperator_(USub_UAdd|Delete_Not|Delete_Invert)|NumberReplacer|AddNot|ZeroIterationForLoop"
    r"|Replace(And|Or|True|False)With(And|Or|True|False)|ReplaceBreakWithContinue|ReplaceContinueWithBreak)"
)

# Most test files of a module, and seconds for them with a fault, compilation included.
NEAREST, LIMIT_S = 6, 900.0


def main() -> None:
    """Plant faults until as many as wanted have been tried, and write ``build/mutants/PART.json``."""
    options = argparse.ArgumentParser(prog="make mutants ARGS=…", description=__doc__)
    options.add_argument("--part", choices=PARTS, default="kernels")
    options.add_argument("--count", type=int, default=200, help="faults, spread evenly over the modules")
    options.add_argument("--seed", type=int, default=1, help="of the sample")
    options.add_argument("--only", default="", help="part of the path of a module")
    wanted = options.parse_args()
    check_out()
    package, tests, names = PARTS[wanted.part]
    paths = {path.relative_to(package).as_posix(): path for path in package.rglob("*.py")}
    modules = [paths[name] for name in sorted(paths) if re.fullmatch(names, name) and wanted.only in name]
    random.Random(wanted.seed).shuffle(modules)
    each = [wanted.count // len(modules) + (k < wanted.count % len(modules)) for k in range(len(modules))]
    records: list[dict[str, object]] = []
    for module, count in zip(modules, each, strict=True):
        if count:
            records += faults(module, nearest_tests(module, package, tests), count, wanted.seed)
            outcomes = Counter(record["outcome"] for record in records)
            summary = {"seed": wanted.seed, "tried": len(records), **outcomes}
            text = json.dumps({"summary": summary, "faults": records}, indent=1, ensure_ascii=False)
            (BUILD / f"{wanted.part}.json").write_text(text + "\n", encoding="utf-8")
            print(f"{outcomes['killed']} of {len(records)} faults killed, last {module.name}", flush=True)


def check_out() -> None:
    """Bring the checkout to the last commit."""
    if not TREE.is_dir():
        subprocess.run(["git", "worktree", "add", "--detach", TREE, "HEAD"], cwd=ROOT, check=True)
    head = subprocess.check_output(["git", "rev-parse", "HEAD"], cwd=ROOT, text=True).strip()
    subprocess.run(["git", "checkout", "-q", "--force", "--detach", head], cwd=TREE, check=True)


def link_compiled_kernels() -> None:
    """Bring compiled kernels: files are named by their sources, and those of a fault replace usual ones."""
    for file in (ROOT / "kernels").rglob("*.nb[ic]"):
        link = TREE / file.relative_to(ROOT)
        if not link.exists():
            link.parent.mkdir(exist_ok=True)
            link.hardlink_to(file)


def nearest_tests(module: Path, package: Path, tests: Path) -> list[Path]:
    """Test files of a module: the mirrored one and others that import it.

    Without any, those of modules that import it, at first or second hand; without these, its whole folder.
    """
    home = tests / module.relative_to(package).parent
    near: set[Path] = set()
    seen, users = set(), {module}
    while users and not near:
        for user in users:
            folder = user.relative_to(package).parent
            mirror, name = tests / folder / f"test_{user.stem}.py", ".".join((package.name, *folder.parts))
            near |= {
                file for file in tests.rglob("test_*.py") if file == mirror or imports(file, name, user.stem)
            }
        seen |= users
        others = {path for path in package.rglob("*.py") if path.stem != "__init__"} - seen
        users = {path for path in others if any(imports(path, r"\.[\w.]*", user.stem) for user in users)}
    ranked = sorted(near, key=lambda file: (file.stem != f"test_{module.stem}", file.parent != home, file))
    return ranked[:NEAREST] or sorted(home.glob("test_*.py"))


@cache
def imports(file: Path, package: str, name: str) -> bool:
    """Whether a file imports a module of a package, or something of it."""
    found = rf"from {package} import (\([^)]*|[^\n]*)\b{name}\b|from {package}\.?\b{name} import "
    return re.search(found, file.read_text(encoding="utf-8")) is not None


def faults(module: Path, tests: list[Path], count: int, seed: int) -> list[dict[str, object]]:
    """Try a sample of the faults of a module; returns their records."""
    name = module.relative_to(TREE).with_suffix("").as_posix().replace("/", ".")
    config, part = BUILD / f"{name}.toml", BUILD / f"{name}.part"
    session = BUILD / f"{name}-{seed}-{count}.sqlite"
    paths = ":".join(str(TREE / folder) for folder in ("kernels", "workers", "service", "."))
    pytest = [
        "env",
        f"PYTHONPATH={paths}",
        "OPENBLAS_NUM_THREADS=1",
        f"{ROOT}/.venv/bin/python",
        "-m",
        "pytest",
    ]
    pytest += ["-x", "-q", "-p", "no:cacheprovider", "-m", "not nightly and not browser"]
    command = json.dumps(shlex.join(pytest + [str(file.relative_to(TREE)) for file in tests]))
    config.write_text(
        f'[cosmic-ray]\nmodule-path = "{module.relative_to(TREE)}"\ntimeout = {LIMIT_S}\n'
        f"excluded-modules = []\ntest-command = {command}\n[cosmic-ray.distributor]\nname = 'local'\n",
        encoding="utf-8",
    )
    cosmic_ray = Path(sys.executable).parent / "cosmic-ray"
    if not session.is_file():
        subprocess.run([cosmic_ray, "init", "--force", config, part], cwd=TREE, check=True)
        database = WorkDB(part, WorkDB.Mode.open)
        items = sorted(database.work_items, key=lambda item: str(item.mutations))
        usual = [item for item in items if OPERATORS.fullmatch(item.mutations[0].operator_name)]
        kept = {item.job_id for item in random.Random(seed).sample(usual, min(count, len(usual)))}
        skipped = WorkResult(worker_outcome=WorkerOutcome.SKIPPED, output="not in the sample")
        database.set_multiple_results((item.job_id for item in items if item.job_id not in kept), skipped)
        database.close()
        part.rename(session)
    link_compiled_kernels()
    subprocess.run([cosmic_ray, "exec", config, session], cwd=TREE, check=True)
    link_compiled_kernels()
    database = WorkDB(session, WorkDB.Mode.open)
    tried: list[dict[str, object]] = []
    for _, result in database.completed_work_items:
        if result.worker_outcome != WorkerOutcome.SKIPPED:
            # Cosmic Ray counts a time-out as killed, but a machine under load looks the same.
            outcome = "timed out" if result.output == "timeout" else result.test_outcome.value
            by = re.findall(r"^(?:FAILED|ERROR) (tests/.+?)(?: - |$)", result.output, re.MULTILINE)
            if by and subprocess.run(pytest + by, cwd=TREE, capture_output=True, check=False).returncode:
                outcome = "fails without a fault"
            tried.append({"module": name, "outcome": outcome, "by": by, "fault": result.diff})
    database.close()
    return tried


if __name__ == "__main__":
    main()
