"""Mutation run: faults planted by Cosmic Ray in the numerics one at a time, and which the nearest tests find.

``make mutants`` installs Cosmic Ray into an environment of its own and runs this; ``ARGS="--only rays"``
narrows it. It works in a checkout of the last commit in ``build/mutants``, with a session of each module, so
that a run can be ended at any time and continues where it was.
"""

import argparse
import json
import random
import re
import shlex
import subprocess
import sys
from pathlib import Path

from cosmic_ray.work_db import WorkDB  # type: ignore[import-not-found]
from cosmic_ray.work_item import WorkerOutcome, WorkResult  # type: ignore[import-not-found]

ROOT = Path(__file__).resolve().parents[1]
BUILD = ROOT / "build/mutants"
TREE = BUILD / "tree"
PACKAGE, TESTS = Path("kernels/bentray_kernels"), Path("tests/kernels")

# Folders of numerics, and files in them without: names, settings, states, and loops that are OpenCL.
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
OTHER = re.compile(
    r"(__init__|registry|dataset|result|\w*settings|\w*checkpoint|\w*graphs?|device_\w+|\w*_opencl)\.py"
)

# Faults that a careless edit makes; the other operators of Cosmic Ray do not even compile.
OPERATORS = re.compile(
    r"core/(ReplaceBinaryOperator_(Add_Sub|Sub_Add|Mul_Div|Div_Mul|Pow_Mul)"
    r"|ReplaceComparisonOperator_(Lt_LtE|LtE_Lt|Gt_GtE|GtE_Gt|Lt_Gt|Gt_Lt|Eq_NotEq|NotEq_Eq)"
    r"|ReplaceUnaryOperator_\w+|NumberReplacer|AddNot|Replace(And|Or)With(Or|And)|ZeroIterationForLoop|BreakContinue"
    r"|ReplaceBreakWithContinue|ReplaceContinueWithBreak)"
)

# Seconds for the tests of a module with a fault, compilation included; a fault that takes longer is killed.
LIMIT_S = 180.0


def main() -> None:
    """Plant faults until as many as wanted have been tried, and write ``build/mutants/mutants.json``."""
    options = argparse.ArgumentParser(prog="make mutants ARGS=…", description=__doc__)
    options.add_argument("--count", type=int, default=200, help="faults, spread evenly over the modules")
    options.add_argument("--seed", type=int, default=1, help="of the sample")
    options.add_argument("--only", default="", help="part of the path of a module")
    wanted = options.parse_args()
    check_out()
    modules = [module for module in numerics() if wanted.only in module.as_posix()]
    random.Random(wanted.seed).shuffle(modules)
    each = [wanted.count // len(modules) + (k < wanted.count % len(modules)) for k in range(len(modules))]
    records: list[dict[str, object]] = []
    for module, count in zip(modules, each, strict=True):
        if count:
            records += faults(module, count, wanted.seed)
            killed = sum(record["outcome"] == "killed" for record in records)
            summary = {"seed": wanted.seed, "tried": len(records), "killed": killed}
            text = json.dumps({"summary": summary, "faults": records}, indent=1, ensure_ascii=False)
            (BUILD / "mutants.json").write_text(text + "\n", encoding="utf-8")
            print(f"{killed} of {len(records)} faults killed, last {module}", flush=True)


def check_out() -> None:
    """Bring the checkout to the last commit."""
    if not TREE.is_dir():
        subprocess.run(["git", "worktree", "add", "--detach", TREE, "HEAD"], cwd=ROOT, check=True)
    head = subprocess.check_output(["git", "rev-parse", "HEAD"], cwd=ROOT, text=True).strip()
    subprocess.run(["git", "checkout", "-q", "--force", "--detach", head], cwd=TREE, check=True)


def numerics() -> list[Path]:
    """Paths of the numerical modules in the checkout, in alphabetical order."""
    paths = (path for folder in FOLDERS for path in (TREE / PACKAGE / folder).rglob("*.py"))
    return sorted(path.relative_to(TREE) for path in paths if not OTHER.fullmatch(path.name))


def nearest_tests(module: Path) -> list[Path]:
    """Test files of a module: the mirrored one and those of its folder that import it; without them, all."""
    folder = TREE / TESTS / module.relative_to(PACKAGE).parent
    mirror = folder / f"test_{module.stem}.py"
    others = sorted(path for path in folder.glob("test_*.py") if path != mirror)
    imports = re.compile(rf"\bimport [^\n]*\b{module.stem}\b|\b{module.stem} import ")
    near = [path for path in others if imports.search(path.read_text(encoding="utf-8"))]
    near = [mirror, *near] if mirror.is_file() else near or others
    return [path.relative_to(TREE) for path in near]


def faults(module: Path, count: int, seed: int) -> list[dict[str, object]]:
    """Try a sample of the faults of a module; returns their records.

    Raises:
        SystemExit: when its tests fail without a fault.
    """
    name = module.with_suffix("").as_posix().replace("/", ".")
    config, session = BUILD / f"{name}.toml", BUILD / f"{name}-{seed}-{count}.sqlite"
    python = ROOT / ".venv/bin/python"
    paths = ":".join(str(TREE / part) for part in ("kernels", "workers", "service", "."))
    tests = " ".join(map(str, nearest_tests(module)))
    command = f"env PYTHONPATH={paths} {python} -m pytest -x -q -p no:cacheprovider {tests}"
    config.write_text(
        f'[cosmic-ray]\nmodule-path = "{module}"\ntimeout = {LIMIT_S}\nexcluded-modules = []\n'
        f"test-command = {json.dumps(command)}\n[cosmic-ray.distributor]\nname = 'local'\n",
        encoding="utf-8",
    )
    cosmic_ray = Path(sys.executable).parent / "cosmic-ray"
    if not session.is_file():
        subprocess.run([cosmic_ray, "init", config, session], cwd=TREE, check=True)
        database = WorkDB(session, WorkDB.Mode.open)
        items = sorted(database.work_items, key=lambda item: str(item.mutations))
        usual = [item for item in items if OPERATORS.fullmatch(item.mutations[0].operator_name)]
        kept = {item.job_id for item in random.Random(seed).sample(usual, min(count, len(usual)))}
        skipped = WorkResult(worker_outcome=WorkerOutcome.SKIPPED, output="not in the sample")
        database.set_multiple_results((item.job_id for item in items if item.job_id not in kept), skipped)
        database.close()
    clean = subprocess.run(shlex.split(command), cwd=TREE, capture_output=True, text=True, check=False)
    if clean.returncode:
        raise SystemExit(f"without a fault, the tests of {module} fail:\n{clean.stdout[-3000:]}")
    subprocess.run([cosmic_ray, "exec", config, session], cwd=TREE, check=True)
    database = WorkDB(session, WorkDB.Mode.open)
    tried = [
        {"module": str(module), "outcome": result.test_outcome.value, "fault": result.diff}
        for _, result in database.completed_work_items
        if result.worker_outcome != WorkerOutcome.SKIPPED
    ]
    database.close()
    return tried


if __name__ == "__main__":
    main()
