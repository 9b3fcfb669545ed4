"""Scoreboard: error, similarity and time of each method on breasts of four densities and public cases."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

import numpy as np

from bentray_kernels.acquisition import Dataset
from bentray_kernels.phantoms import DENSITIES, DETAILED_SIDE_M, DetailedBreast
from bentray_kernels.tomography import Reconstruction, Settings
from bentray_kernels.tomography.comparison import compare
from bentray_service.cli.output.benchmark_context import BenchmarkContext
from bentray_service.cli.output.benchmark_row import (
    BEST_CONSTANT,
    DEFAULT_SETTINGS,
    STRAIGHT_RAYS,
    WATER_ALONE,
    Row,
)
from bentray_workers.files.dataset import write_dataset
from bentray_workers.reconstruction import reconstruction_run

from ..any_scan._images_beside_truth import images_beside_truth
from ..shared._baselines import Images
from ..shared._image_error import object_error
from ..shared._reconstruction_on_workers import Made
from ..shared._recorded_scans import with_trace_noise
from ..shared._ring_scan import RingScan
from ..waves._kwave_peer import Peer, installed
from ._benchlab_cases import WATER_MPS, PublicCase, benchlab_scans, mean_speed, scores

SNR = 30.0

# Half the size of a breast, so that minutes suffice: 300 kHz there are 150 kHz in a breast of full size.
SIDE_M, RADIUS_M, CENTRE_HZ, ELEMENTS, EMISSIONS = 0.12, 0.054, 3e5, 128, 48
QUICK = (1e5, 64, 16)

# All by their default settings; attenuation is not compared.
WAYS: dict[str, dict[str, Any]] = {
    "SART": {"method": "sart"},
    "Gauss-Newton": {"method": "gauss-newton"},
    "auto": {"method": "auto"},
    "waveform": {"method": "waveform"},
}

# Goals of full waveforms: rms error in m/s, and minutes on two cores in s.
WAVEFORM_MPS, WAVEFORM_S = 10.0, 300.0


def density_scans(peer: Peer | None, context: BenchmarkContext) -> Iterator[tuple[str, Dataset]]:
    """Each density with its scan; in a quick run one of them.

    Args:
        peer: k-Wave, or None: our simulator.
        context: with the progress.
    """
    centre, elements, emissions = QUICK if context.quick else (CENTRE_HZ, ELEMENTS, EMISSIONS)
    names = list(DENSITIES)[: 1 if context.quick else None]
    breasts = {name: DetailedBreast(WATER_MPS, anatomy=DENSITIES[name]) for name in names}
    lowest, highest = zip(*(breast.speed_range() for breast in breasts.values()), strict=True)
    size = RingScan(
        SIDE_M, RADIUS_M, centre, elements, emissions, (min(lowest), max(highest)), WATER_MPS, peer
    )
    # The phantom of full size on a grid of half of it.
    speeds = {name: breast.speed(size.nodes, DETAILED_SIDE_M) for name, breast in breasts.items()}
    still = np.full((size.nodes, size.nodes), WATER_MPS)
    water = size.recorded({"water": still}, context.progress)["water"]
    for seed, (name, breast) in enumerate(breasts.items()):
        traces = size.recorded({name: speeds[name]}, context.progress)[name]
        inside = breast.inside(size.nodes, DETAILED_SIDE_M)
        yield name, with_trace_noise(size.dataset(traces, water, speeds[name], inside), SNR, seed=20 + seed)


def rows(context: BenchmarkContext) -> Iterable[Row]:
    """Rows of the breasts, and of the cases in the folder ``--data``, if it is given."""
    peers, why = installed()
    peer = peers.get("k-Wave")
    solver = "waves by k-Wave" if peer else f"waves on a grid twice as fine; {why['k-Wave']}"
    drawn: dict[str, tuple[Dataset, Mapping[str, Made]]] = {}
    for name, scan in density_scans(peer, context):
        images = _Runs(scan, context)
        yield from _compared(name, scan, images, solver)
        drawn[name] = (scan, images.by_way)
    if drawn:
        title = "Breasts of four densities: error in the breast, and time"
        context.save_picture("scoreboard.png", lambda: images_beside_truth(title, drawn))
    for case, scan in benchlab_scans(context, peer):
        yield from _public(case, _Runs(scan, context), solver)


def _public(case: PublicCase, runs: _Runs, solver: str) -> Iterator[Row]:
    """Rows of a case of usct-benchlab, on its grid and in its region."""
    constants = {BEST_CONSTANT: mean_speed(case), WATER_ALONE: WATER_MPS}
    baselines = {name: scores(value, case).rmse for name, value in constants.items()}
    baselines[DEFAULT_SETTINGS] = scores(runs.images.default().result, case).rmse
    for way, made in runs.by_way.items():
        score = scores(made.result, case)
        straight = scores(runs.images.straight(made.result), case).rmse
        yield Row(
            f"{case.name}, {way}: RMSE",
            score.rmse,
            WAVEFORM_MPS,
            "<=",
            "m/s",
            f"{solver}; on the grid and in the tissue of usct-benchlab; load {os.getloadavg()[0]:.1f}",
            baselines={**baselines, STRAIGHT_RAYS: straight},
            figures={**score.figures, "seconds": made.seconds},
        )


class _Runs:
    """A scan reconstructed in each way, on one cluster of two workers."""

    def __init__(self, scan: Dataset, context: BenchmarkContext) -> None:
        self.by_way: dict[str, Made] = {}
        with context.temporary_folder() as folder, context.cluster() as cluster:
            path = folder / "scan.h5"
            write_dataset(path, scan)

            def run(_: Dataset, settings: Settings) -> Reconstruction:
                return reconstruction_run.reconstruct(
                    cluster.client,
                    path,
                    settings,
                    lambda now: context.progress(now.done, now.total, settings.method),
                )

            plain = Settings.from_values(attenuation=False)
            self.images = Images(scan, run, plain)
            error = object_error(scan)
            for way, changes in WAYS.items():
                image = self.images.made(plain.changed(**changes))
                rms = error(image.result).of(image.result)
                self.by_way[way] = Made(image.result, rms, image.seconds)
            self.compared = {
                way: self.images.compared(made.result, error) for way, made in self.by_way.items()
            }


def _compared(name: str, scan: Dataset, runs: _Runs, solver: str) -> Iterator[Row]:
    assert scan.truth is not None
    size = f"{len(scan.element_position_m)} elements, {len(scan.tx)} emit; {solver}"
    for way, made in runs.by_way.items():
        comparison, compared = compare(made.result, scan.truth, scan.roi), runs.compared[way]
        settings = made.result.settings
        detail = f"{size}; {settings.rays} {settings.method}, {made.result.speed.shape[0]}² nodes; "
        goal, kind = WAVEFORM_MPS, "<="
        if way == "auto":
            goal = compared.baselines[STRAIGHT_RAYS]
            detail += "goal: that of straight rays; "
        elif way != "waveform":
            goal = compared.baselines[BEST_CONSTANT]
            detail += "goal: that of the best constant; "
        yield Row(
            f"{name}, {way}: RMSE",
            compared.error,
            goal,
            kind,
            "m/s",
            detail + f"load {os.getloadavg()[0]:.1f}",
            baselines=compared.baselines,
            figures={
                "RMSE": comparison.rms,
                "MAE": comparison.mean_absolute,
                "SSIM": comparison.ssim,
                "PCC": comparison.correlation,
                "seconds": made.seconds,
            },
        )
    seconds = runs.by_way["waveform"].seconds
    detail = f"two workers; load {os.getloadavg()[0]:.1f}"
    yield Row(f"{name}, waveform: time", seconds, WAVEFORM_S, "<=", "s", detail)
