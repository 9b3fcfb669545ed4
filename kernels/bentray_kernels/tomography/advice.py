"""Which rays and method explain a scan best: each is shown part of the pairs and must predict the others."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, Literal

import numpy as np

from ..acquisition import Dataset
from ..acquisition.noise import noise_level
from ..arrays import Floats
from ..errors import InvalidInput
from . import pairs
from .chains import Chain, Gathering, Scan, cut
from .gauss_newton import look
from .linearisation import Rows
from .result import Reconstruction, Trial
from .settings import Settings
from .stages import stages

Part = Literal["all", "shown", "held-out"]
PARTS: tuple[Part, ...] = ("shown", "held-out")

# One pair in so many is held out, both directions together.
HELD_OUT = 10

# What is tried: bent rays lose where the picked times are not those of the Eikonal equation.
CANDIDATES: tuple[dict[str, Any], ...] = (
    {"rays": "straight", "method": "sart"},
    {"rays": "straight", "method": "gauss-newton"},
    {"rays": "curved", "method": "sart"},
    {"rays": "curved", "method": "sart", "front_smoothing_nodes": 4.0},
    {"rays": "curved", "method": "gauss-newton"},
    {"rays": "curved", "method": "gauss-newton", "edge_mps": 7.0},
)

# Trials use half the nodes, but not fewer than this.
TRIAL_NODES = 64

# Bent rays must predict held-out pairs this much better than straight ones, which ask for less belief. On a
# wave simulation whose bent image was 2 m/s worse than the straight one the ratio was 0.95; on Eikonal times
# from 0.9 (water faster than a fat ring) down to 0.35.
CLEARLY = 0.92

# A misfit of this many times the noise explains the times (the factor of Morozov's principle).
EXPLAINED = 1.1


def part_of(dataset: Dataset, part: Part) -> Dataset:
    """The dataset with the pairs of one part only, the others invalid.

    A pair and its reverse belong to the same part, in all slices.
    """
    if part == "all":
        return dataset
    first = np.minimum(dataset.tx[:, None], dataset.rx[None, :]).astype(np.uint64)
    second = np.maximum(dataset.tx[:, None], dataset.rx[None, :]).astype(np.uint64)
    # A mix of both numbers, so that no direction or ring is held out as a whole.
    mixed = (first * np.uint64(0x9E3779B1) + second * np.uint64(0x85EBCA77)) >> np.uint64(11)
    held = (mixed % np.uint64(HELD_OUT)) == 0
    kept = held if part == "held-out" else ~held
    shape = kept.shape if dataset.slice_z_m is None else (dataset.slices, *kept.shape)
    valid = np.broadcast_to(kept, shape)
    return replace(dataset, valid=valid.copy() if dataset.valid is None else valid & dataset.valid)


def tried(settings: Settings) -> list[Settings]:
    """The settings of each trial: those of the candidates on a coarser grid."""
    nodes = min(settings.nodes, max(TRIAL_NODES, -(-settings.nodes // 2)))
    found = []
    for changes in CANDIDATES:
        plan = replace(settings, **changes, attenuation=False, resolution_check=False)
        front = plan.front_smoothing_nodes * nodes / settings.nodes
        found.append(replace(plan, nodes=nodes, coarser_grids=0, front_smoothing_nodes=front))
    return found


class TrialChain(Chain):
    """A chain on the pairs that are shown, which ends with the misfit of those held out.

    Args:
        scan: of the shown pairs.
        index: of the slice.
        held_out: of the held-out pairs.
    """

    def __init__(self, scan: Scan, index: int, held_out: Scan) -> None:
        self._held_out = held_out
        super().__init__(scan, index)

    def _gatherings(self) -> list[Gathering]:
        return [HeldOut(self._held_out, self._index)]

    @property
    def held_out_rms_s(self) -> float:
        """Misfit of the pairs that were held out, s."""
        return float(self.found(misfit))


class HeldOut(Gathering):
    """The rays of the pairs that were held out."""

    def __init__(self, scan: Scan, index: int) -> None:
        self._scan = scan
        super().__init__(look_held_out, misfit, scan.problem(index).sounding)

    def first(self, scan: Scan, index: int, image: Floats) -> list[Any]:
        return super().first(self._scan, index, image)


def look_held_out(scan: Scan, index: int, slowness: Floats, part: int) -> Rows:
    """Call: the rays of some held-out pairs through the finished image."""
    problem = scan.problem(index)
    return look(problem, scan.stages()[-1], slowness, cut(problem.sounding)[part])


def misfit(_scan: Scan, _index: int, rows: Sequence[Rows]) -> float:
    """Call: root mean square of the residuals, s."""
    residual = np.concatenate([part.residual for part in rows])
    return math.sqrt(float((residual**2).mean()))


def advise(
    dataset: Dataset,
    settings: Settings,
    index: int,
    scan_of: Callable[[Settings, Part], Scan],
    drive: Callable[[Sequence[Chain], int, int], None],
    after: int = 0,
) -> tuple[Settings, tuple[Trial, ...], int]:
    """The settings that explain one slice best, and how all that were tried did.

    What predicts held-out pairs best is chosen. The reconstruction is told to stop at the noise of the times
    (Morozov's discrepancy principle), for a closer fit would draw it, unless the trial shows that there is
    less of it.

    Args:
        dataset: for the noise of its times.
        settings: that leave rays and method to the trials.
        index: the slice to try.
        scan_of: makes a scan of a part of the pairs.
        drive: runs chains to their end.
        after: emitter passes that come after the reconstruction, at most.

    Returns:
        The settings; the trials, the chosen one first and the others by what they predict; and the emitter
        passes that they took.

    Raises:
        InvalidInput: for a slice without pairs, or with too few to hold some out.
    """
    _check_parts(settings, index, scan_of)
    chains = [
        TrialChain(scan_of(plan, "shown"), index, scan_of(plan, "held-out")) for plan in tried(settings)
    ]
    drive(chains, 0, passes_to_come(dataset, settings) + after)
    trials = [
        Trial(changes, chain.held_out_rms_s, chain.history[-1].residual_rms_s)
        for changes, chain in zip(CANDIDATES, chains, strict=True)
    ]
    chosen = choose(trials)
    others = sorted((t for t in trials if t is not chosen), key=lambda trial: trial.held_out_rms_s)
    found = replace(settings, **chosen.settings)
    passes = sum(chain.total for chain in chains)
    return stopped(found, chosen, noise_of(dataset)), (chosen, *others), passes


def passes_to_come(dataset: Dataset, settings: Settings) -> int:
    """Emitter passes that a reconstruction takes at most, whichever candidate is chosen."""
    plans = [stages(dataset, replace(settings, **changes)) for changes in CANDIDATES]
    each = max(sum(plan.sweeps for plan in found) for found in plans)
    each += settings.attenuation and dataset.log_ratio_np is not None
    each += settings.resolution_check
    problems = range(pairs.count(dataset, settings))
    return each * sum(len(pairs.of(dataset, settings, index).emitters) for index in problems)


def _check_parts(settings: Settings, index: int, scan_of: Callable[[Settings, Part], Scan]) -> None:
    plan = tried(settings)[0]
    scan_of(plan, "all").problem(index)
    for part in PARTS:
        try:
            scan_of(plan, part).problem(index)
        except InvalidInput as found:
            raise InvalidInput(
                "method",
                repr(settings.method),
                f"sart or gauss-newton, for slice {index} has no pair that is {part}",
            ) from found


def stopped(settings: Settings, chosen: Trial, noise_s: float) -> Settings:
    """The settings with the misfit to stop at, unless the chosen trial shows that there is less noise."""
    if settings.stop_rms_s == 0.0 and noise_s <= EXPLAINED * chosen.held_out_rms_s:
        return replace(settings, stop_rms_s=EXPLAINED * noise_s)
    return settings


def noise_of(dataset: Dataset) -> float:
    """Standard deviation of the travel times, s: as the dataset tells it, or as their roughness does."""
    if dataset.sigma_s is not None:
        told = dataset.sigma_s[np.isfinite(dataset.differential_tof()) & np.isfinite(dataset.sigma_s)]
        if told.size:
            return math.sqrt(float((told**2).mean()))
    return noise_level(dataset.differential_tof())


def choose(trials: Sequence[Trial]) -> Trial:
    """The trial that predicts best; one with straight rays unless bent ones are clearly better."""
    best = min(trials, key=lambda trial: trial.held_out_rms_s)
    straight = min(
        (trial for trial in trials if trial.settings["rays"] == "straight"),
        key=lambda trial: trial.held_out_rms_s,
    )
    return best if best.held_out_rms_s < CLEARLY * straight.held_out_rms_s else straight


def reason(trials: Sequence[Trial]) -> str:
    """One sentence: what was chosen and why, and how well each trial predicted; empty without trials."""
    if not trials:
        return ""
    told = [f"{_named(trial.settings)} {1e9 * trial.held_out_rms_s:.0f} ns" for trial in trials]
    best = min(trial.held_out_rms_s for trial in trials)
    why = "misfit of held-out pairs"
    if trials[0].held_out_rms_s > best:
        why += f"; bent rays must be {100.0 * (1.0 - CLEARLY):.0f} % better"
    return f"auto chose {told[0]} ({why}); the others: {', '.join(told[1:])}"


def told(result: Reconstruction) -> str:
    """What ``reason`` says of a result, and what waves gave or would; empty where nothing was tried."""
    return "; ".join(part for part in (reason(result.trials), result.provenance.get("waveform", "")) if part)


def _named(changes: dict[str, Any]) -> str:
    """As ``straight sart`` or ``curved sart (front_smoothing_nodes 4)``."""
    more = [f"{name} {value:g}" for name, value in changes.items() if name not in ("rays", "method")]
    plain = " ".join(str(changes[name]) for name in ("rays", "method") if name in changes)
    return f"{plain} ({', '.join(more)})" if more else plain
