"""Mutation run: faults planted in the numerics one at a time, and which of them the nearest tests find.

``make mutants`` runs it; ``ARGS="--count 200"`` and the other options of ``--help`` narrow it. It works in
copies in a temporary folder and can be ended at any time: the next run continues after the last fault.
"""

from __future__ import annotations

import argparse
import importlib
import json
import signal
import sys
import tempfile
from collections import Counter
from pathlib import Path
from typing import Any

from .device_benchmark import Outcome, copy_of, replace_text, run_tests
from .equivalent_faults import EQUIVALENT
from .nearest_tests import PACKAGE, near, wide
from .planted_faults import Fault
from .sampling import entry, key, sample

ROOT = Path(__file__).resolve().parents[2]

# Processor seconds of one run of tests, compilation included; a fault that takes longer counts as found.
LIMIT_S = 75.0

# Imported once, before the first process is forked.
LIBRARIES = (
    "PIL.Image",
    "hypothesis.strategies",
    "matplotlib.figure",
    "numba",
    "pyopencl",
    "pytest",
    "scipy.ndimage",
    "scipy.optimize",
    "scipy.sparse.linalg",
    "scipy.spatial",
    "trimesh",
)


def main() -> None:
    """Plant faults until as many as wanted have been tried."""
    wanted = _arguments()
    done: dict[str, dict[str, Any]] = {}
    if wanted.file.is_file():
        done = {key(one): one for one in json.loads(wanted.file.read_text(encoding="utf-8"))["faults"]}
    sampled = sample(ROOT, wanted.count, wanted.seed)
    left = [one for one in sampled if wanted.only in one[0] and _is_left(done.get(key(entry(*one))), wanted)]
    # Survivors first, then those with little to run: a run that is ended early has tried more.
    left.sort(key=lambda one: (key(entry(*one)) not in done, _to_run(one[0])))
    print(f"{len(sampled)} faults, {len(left)} of them to try; state in {wanted.file}", flush=True)
    if wanted.list:
        for module, fault in left:
            print(f"{module}:{fault.line} {fault.kind}: {fault.before}  ->  {fault.after}")
        return
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
    for name in LIBRARIES:
        importlib.import_module(name)
    # The modules of the copies come from the copies alone.
    sys.path[:] = [one for one in sys.path if Path(one or ".").resolve() not in (ROOT, ROOT / "tests")]
    with tempfile.TemporaryDirectory(prefix="bentray-mutants-") as scratch:
        trials = Trials(Path(scratch))
        for number, (module, fault) in enumerate(left, 1):
            found = trials.of(module, fault, everything=wanted.wide)
            done[key(found)] = found
            print(
                f"{number}/{len(left)} {found['outcome']:8} {found['seconds']:5.0f} s  "
                f"{module}:{fault.line} {fault.before}  ->  {fault.after}",
                flush=True,
            )
            save(wanted.file, wanted, [done[k] for one in sampled if (k := key(entry(*one))) in done])
    save(wanted.file, wanted, [done[k] for one in sampled if (k := key(entry(*one))) in done])
    print(json.dumps(json.loads(wanted.file.read_text(encoding="utf-8"))["summary"]))


def _arguments() -> argparse.Namespace:
    options = argparse.ArgumentParser(prog="make mutants ARGS=…", description=__doc__)
    options.add_argument("--count", type=int, default=220, help="faults, spread evenly over the modules")
    options.add_argument("--seed", type=int, default=1, help="of the sample")
    options.add_argument("--file", type=Path, default=ROOT / "build/mutants.json", help="state and results")
    options.add_argument("--only", default="", help="part of the path of a module")
    options.add_argument("--survivors", action="store_true", help="try those again that survived")
    options.add_argument("--wide", action="store_true", help="with all tests of the part of the kernels")
    options.add_argument("--list", action="store_true", help="print the faults and end")
    return options.parse_args()


def _to_run(module: str) -> int:
    """Bytes of the nearest tests."""
    return sum((ROOT / file).stat().st_size for file in near(ROOT, module))


def _is_left(known: dict[str, Any] | None, wanted: argparse.Namespace) -> bool:
    return known is None or (wanted.survivors and known["outcome"] == "survived")


class Trials:
    """Faults tried one after the other in copies of the sources.

    Attributes:
        clean: the copy without a fault, in which tests that found one are confirmed.
    """

    def __init__(self, scratch: Path) -> None:
        self.clean, self.damaged = scratch / "clean", scratch / "damaged"
        self.confirmed: dict[tuple[str, ...], Outcome] = {}
        copy_of(ROOT, self.clean)
        for path in self.clean.rglob("*"):
            # Not the files of the working tree, which an editor may change in place.
            if path.is_file() and path.suffix in (".py", ".toml", ".cl"):
                replace_text(path, path.read_text(encoding="utf-8"))

    def of(self, module: str, fault: Fault, *, everything: bool) -> dict[str, Any]:
        """The entry of a fault with its outcome: killed or survived."""
        found = entry(module, fault)
        files = near(self.clean, module)
        stages = [files, *([one] for one in wide(self.clean, module))] if everything else [files]
        seconds = 0.0
        for stage in stages:
            outcome = self._try(module, fault, stage)
            seconds += outcome.seconds
            if outcome.ended in ("failed", "timeout"):
                found |= {"outcome": "killed", "by": outcome.test or outcome.ended}
                break
        else:
            found |= {"outcome": "survived", "by": ""}
        return found | {"seconds": round(seconds, 1)}

    def _try(self, module: str, fault: Fault, files: list[str]) -> Outcome:
        copy_of(self.clean, self.damaged)
        path = self.damaged / PACKAGE / module
        replace_text(path, fault.planted(path.read_text(encoding="utf-8")))
        outcome = run_tests(self.damaged, files, LIMIT_S)
        if outcome.ended in ("failed", "timeout"):
            self._confirm([outcome.test] if outcome.test else files)
        return outcome

    def _confirm(self, tests: list[str]) -> None:
        """What failed with a fault must pass without, in less time.

        Raises:
            SystemExit: if not; then a test of this working tree fails, or is too slow.
        """
        known = tuple(tests)
        if known not in self.confirmed:
            self.confirmed[known] = run_tests(self.clean, tests, 0.6 * LIMIT_S)
        if self.confirmed[known].ended != "passed":
            log = (self.clean / "tests.log").read_text(encoding="utf-8", errors="replace")
            raise SystemExit(
                f"without a fault {' '.join(tests)} {self.confirmed[known].ended}:\n{log[-4000:]}"
            )


def save(file: Path, wanted: argparse.Namespace, faults: list[dict[str, Any]]) -> None:
    """Write the faults and their summary; survivors that change no result are marked with the reason."""
    faults = [dict(one) for one in faults]
    for one in faults:
        one.pop("reason", None)
        if one["outcome"] != "killed":
            reason = EQUIVALENT.get(key(one))
            one["outcome"] = "equivalent" if reason else "survived"
            if reason:
                one["reason"] = reason
    parts: dict[str, Counter[str]] = {}
    for one in faults:
        parts.setdefault(one["module"].split("/")[0], Counter())[one["outcome"]] += 1
    total = sum(parts.values(), Counter())
    counted = total["killed"] + total["survived"]
    summary = {
        "sampled": wanted.count,
        "tried": total.total(),
        **{name: total[name] for name in ("killed", "survived", "equivalent")},
        "killed_part": round(total["killed"] / counted, 4) if counted else None,
        "parts": {part: dict(sorted(counts.items())) for part, counts in sorted(parts.items())},
    }
    file.parent.mkdir(parents=True, exist_ok=True)
    partial = file.with_suffix(".partial")
    text = json.dumps(
        {"seed": wanted.seed, "summary": summary, "faults": faults}, indent=1, ensure_ascii=False
    )
    partial.write_text(text + "\n", encoding="utf-8")
    partial.replace(file)


if __name__ == "__main__":
    main()
