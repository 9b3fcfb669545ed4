"""Estimated duration of a job: its counted work times what the tenant's finished jobs of its class took.

Only jobs of the same tenant are read, so that no duration tells one tenant about the work of another. Until
there are any, the jobs of other classes tell how fast this machine is, and until there are any of those the
speed of another machine gives the order of magnitude; a class without such a speed has no estimate.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from statistics import median
from typing import Any

# Finished jobs of a kind that are looked at, and those of one class whose median counts.
READ, COMPARED = 200, 10
# With fewer, an estimate is rough.
ENOUGH = 3


@dataclass(frozen=True)
class Estimate:
    """An estimated duration.

    Attributes:
        minutes: from start to end, without other jobs; None without a sound estimate.
        compared: number of finished jobs that it is based on.
        basis: where it comes from, in a sentence.
    """

    minutes: float | None
    compared: int
    basis: str

    @property
    def rough(self) -> bool:
        """Whether it is an order of magnitude."""
        return self.compared < ENOUGH


def estimate(plan: Mapping[str, Any] | None, finished: Sequence[tuple[Mapping[str, Any], float]]) -> Estimate:
    """The estimated duration of a planned job.

    Args:
        plan: of the job, with ``work_class``, ``work_s`` and ``speed_known``, or ``minutes`` of a simulation.
        finished: plan and duration, s, of jobs of the same kind and tenant, the newest first.
    """
    planned = _work(plan)
    if planned is None:
        return Estimate(None, 0, "No estimate yet: jobs of this kind are not counted.")
    name, seconds, measurable = planned
    counted = [(work, took) for other, took in finished if (work := _work(other)) is not None]
    ratios = [took / work[1] for work, took in counted if work[0] == name][:COMPARED]
    if ratios:
        jobs = "one finished job" if len(ratios) == 1 else f"{len(ratios)} finished jobs"
        return Estimate(median(ratios) * seconds / 60.0, len(ratios), f"From {jobs} of the same method.")
    if not measurable:
        return Estimate(None, 0, "No estimate yet: no job of this method has finished here.")
    none = "no job of this method has finished here."
    others = [(work[1], took) for work, took in counted if work[2]][:COMPARED]
    if not others:
        return Estimate(seconds / 60.0, 0, f"Rough, from another machine: {none}")
    # The sums, since what every job takes at its start would make small ones look slow.
    ratio = sum(took for _, took in others) / sum(work for work, _ in others)
    return Estimate(ratio * seconds / 60.0, 0, f"Rough, from jobs of other methods: {none}")


def _work(plan: Mapping[str, Any] | None) -> tuple[str, float, bool] | None:
    """Class, seconds and whether its speed is known; None for a plan without them."""
    if plan is None:
        return None
    if plan.get("work_class") and plan.get("work_s", 0.0) > 0.0:
        return plan["work_class"], float(plan["work_s"]), bool(plan.get("speed_known"))
    if plan.get("minutes"):
        return "simulation", 60.0 * plan["minutes"], True
    return None
