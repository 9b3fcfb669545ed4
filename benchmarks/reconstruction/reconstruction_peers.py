"""R6: other reconstruction methods on the travel times of an untuned slice: errors and times."""

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

import numpy as np

from bentray_kernels.acquisition import Dataset
from bentray_kernels.tomography import Reconstruction, Settings, reconstruct, rmse
from bentray_service.cli.output.benchmark_context import BenchmarkContext
from bentray_service.cli.output.benchmark_row import Row
from bentray_service.cli.output.terminal import Step

from ..eikonal import _eikonal_peers
from ..shared._baselines import Compared, Images
from ..shared._image_error import object_error
from . import _tomography_peers
from ._tomography_peers import Peer
from ._tomography_scan import SIDE_M, SOLVER, scan
from ._travel_times import TravelTimes

COUPLINGS_MPS = (1500.0, 1475.0)

# Ours, by the name in the rows; the first is compared with the peers. Nothing is tuned.
OURS = {
    "default": Settings(),
    "gauss-newton": Settings.from_values(method="gauss-newton", side_m=SIDE_M, attenuation=False),
    "sart": Settings.from_values(method="sart", side_m=SIDE_M, attenuation=False),
}

RMSE_GOAL_MPS, SECONDS_GOAL = 28.0, 10.0


@dataclass(frozen=True)
class Found:
    """An image's error inside the breast, m/s, and what it took: on the clock, and of one processor, s."""

    rmse_mps: float
    seconds: float
    processor_s: float

    def __str__(self) -> str:
        return f"{self.rmse_mps:.1f} m/s in {self.processor_s:.1f} s"


def rows(context: BenchmarkContext) -> Iterable[Row]:
    """R6: ours against a goal, then each peer over our default settings, above 1 where ours is better.

    The same times for all, made by a third package on a grid four times finer. Runs of minutes are timed
    once, after a tiny one that compiles and imports; peers run on one thread, ours on all cores, compared by
    processor time. The strengths of the peers are tuned on this slice. The mesh that pyGIMLi
    gets is too coarse in the quick run, and its error there is not what it can do.
    """
    nodes, elements = (64, 64) if context.quick else (128, 256)
    peers, missing = _tomography_peers.installed()
    solvers, without = _eikonal_peers.installed()
    for coupling in COUPLINGS_MPS[: 1 if context.quick else None]:
        water = f"water {coupling:g}"
        if SOLVER not in solvers:
            yield Row(f"R6 unseen slice rmse, {water}", None, RMSE_GOAL_MPS, "<=", "m/s", without[SOLVER])
            continue

        def made(done: int, total: int, water: str = water) -> None:
            context.progress(done, total, f"travel times, {water}")

        tiny = scan(coupling, 32, 16, solvers[SOLVER], lambda done, total: None)
        dataset = scan(coupling, nodes, elements, solvers[SOLVER], made)
        ours = run_ours(dataset, tiny, nodes, context.progress)
        how = f"{nodes}² nodes of the truth, {elements} elements, {SOLVER} times"
        for name, (own, compared) in ours.items():
            label = f"{name}, {water}"
            took = f"{own}, {how}"
            yield compared.row(
                f"R6 unseen slice rmse, {label}", own.rmse_mps, RMSE_GOAL_MPS, "<=", "m/s", took
            )
            clock = f"{own.processor_s:.1f} s of processors, {how}"
            yield compared.row(f"R6 unseen slice time, {label}", own.seconds, SECONDS_GOAL, "<", "s", clock)
        first = next(iter(OURS))
        for k, name in enumerate(_tomography_peers.PEERS):
            context.progress(k, len(_tomography_peers.PEERS), f"{name}, {water}")
            theirs = run_peer(peers[name], dataset, tiny) if name in peers else None
            yield from peer_rows(f"{name}, {water}", theirs, *ours[first], first, missing.get(name, ""))
    context.progress(1, 1, "done")


def peer_rows(
    label: str, theirs: Found | None, ours: Found, compared: Compared, method: str, reason: str
) -> Iterable[Row]:
    """A peer's error and time over ours."""
    targets = f"R6 rmse below {label}", f"R6 time below {label}"
    if theirs is None:
        yield from (Row(target, None, 1.0, ">", "", reason) for target in targets)
        return
    detail = f"theirs {theirs}, {method} {ours}; processor time, one run each"
    ratios = theirs.rmse_mps / ours.rmse_mps, theirs.processor_s / ours.processor_s
    for target, ratio in zip(targets, ratios, strict=True):
        yield compared.row(target, ratio, 1.0, ">", "", detail)


def run_ours(
    dataset: Dataset, tiny: Dataset, nodes: int, progress: Step
) -> dict[str, tuple[Found, Compared]]:
    """Reconstructions of ours, in this process, each after one of a tiny scan."""
    spent: dict[Settings, float] = {}

    def run(of: Dataset, settings: Settings) -> Reconstruction:
        started = time.process_time()
        result = reconstruct(of, settings, lambda p: progress(p.done, p.total, settings.method))
        spent[settings] = time.process_time() - started
        return result

    images, error_on = Images(dataset, run), object_error(dataset)
    measured = {}
    for name, settings in OURS.items():
        # The default settings choose their own grid.
        asked = settings if settings.selects_model else replace(settings, nodes=nodes)
        run(tiny, replace(asked, nodes=None))
        image, seconds = images.made(asked)
        compared = images.compared(image, error_on)
        measured[name] = Found(compared.error, seconds, spent[asked]), compared
    return measured


def run_peer(peer: Peer, dataset: Dataset, tiny: Dataset) -> Found:
    """A peer's reconstruction, after one of a tiny scan."""

    def times(of: Dataset) -> TravelTimes:
        assert of.truth is not None
        return TravelTimes.from_dataset(of, len(of.truth.sound_speed_mps), SIDE_M)

    peer(times(tiny))
    given = times(dataset)
    return timed(lambda: peer(given), dataset)


def timed(run: Callable[[], np.ndarray], dataset: Dataset) -> Found:
    """Result and cost of one run."""
    assert dataset.truth is not None
    started, spent = time.perf_counter(), time.process_time()
    speed = run()
    seconds, processor_s = time.perf_counter() - started, time.process_time() - spent
    return Found(rmse(speed, dataset.truth.sound_speed_mps, dataset.roi), seconds, processor_s)
