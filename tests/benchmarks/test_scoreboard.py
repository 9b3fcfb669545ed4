"""The scoreboard: layouts of public cases, their region and errors, its scans, and its table in the guide."""

import io
import json
import zipfile
from pathlib import Path

import h5py
import numpy as np
import pytest
from benchmarks.scoreboard._benchlab_cases import (
    NBP,
    OPENBREASTUS,
    SIDE_M,
    WATER_MPS,
    PublicCase,
    mean_speed,
    read_cases,
    scores,
    tissue,
)
from benchmarks.shared._ring_scan import OWN_NODES_A_WAVE, RingScan
from docs.from_code import scoreboard

from ..kernels.tomography.comparison.squares import image


def disc(nodes: int, speed: float) -> np.ndarray:
    """A disc in water, with water inside and a spot off the middle, so that no axis can be exchanged."""
    x, y = np.meshgrid(*(np.linspace(-1.0, 1.0, nodes),) * 2, indexing="ij")
    made = np.where(np.hypot(x, y) < 0.6, speed, WATER_MPS)
    made[np.hypot(x, y) < 0.1] = WATER_MPS
    made[np.hypot(x - 0.3, y) < 0.1] = 1570.0
    return made


def write_openbreastus(path: Path, count: int = 701, *, last: bool = True) -> None:
    with h5py.File(path, "w") as file:
        maps = file.create_dataset(
            "breast_test", (24, 24, count) if last else (count, 24, 24), np.float32, fillvalue=WATER_MPS
        )
        for index, speed in ((0, 1440.0), (200, 1450.0), (500, 1460.0), (700, 1470.0)):
            if index < count:
                maps[(..., index) if last else (index,)] = disc(24, speed)


def write_nbp(path: Path, **changes: np.ndarray) -> None:
    speed = 1e-3 * np.pad(disc(30, 1450.0), ((0, 8), (0, 0)), constant_values=1480.0)
    arrays = {"sos": speed, "label": np.pad(np.where(disc(30, 1450.0) == WATER_MPS, 0, 2), ((0, 8), (0, 0)))}
    with zipfile.ZipFile(path, "w") as archive:
        for name in ("A540024479", "D510022534"):
            content = io.BytesIO()
            with h5py.File(content, "w") as file:
                for place, array in {**arrays, **changes}.items():
                    if array is not None:
                        file[place] = array
            archive.writestr(f"NBPslices2D/{name}.mat", content.getvalue())


@pytest.mark.parametrize("last", [True, False])
def test_maps_of_openbreastus_are_its_four_cases(tmp_path: Path, last: bool) -> None:
    write_openbreastus(tmp_path / OPENBREASTUS, last=last)
    cases = list(read_cases(tmp_path))
    assert [case.name.split()[1] for case in cases] == ["HET", "FIB", "FAT", "EXD"]
    for case, speed in zip(cases, (1440.0, 1450.0, 1460.0, 1470.0), strict=True):
        np.testing.assert_allclose(case.speed_mps, disc(24, speed))
    truth = cases[0].truth()
    assert (truth.spacing_m, truth.origin_m) == ((0.5e-3,) * 2, (-0.5e-3 * 11.5,) * 2)


def test_slices_of_nbp_are_centred_in_water_in_metres_per_second(tmp_path: Path) -> None:
    write_nbp(tmp_path / NBP)
    fatty, dense = read_cases(tmp_path)
    assert (fatty.name, dense.name, fatty.pixel_m) == ("NBP A", "NBP D", 1e-4)
    inside = fatty.speed_mps != WATER_MPS
    assert set(np.round(fatty.speed_mps[inside], 6).tolist()) == {1450.0, 1570.0}
    assert not np.isclose(fatty.speed_mps, 1480.0).any(), "outside the label is water"
    points = np.argwhere(inside)
    assert np.abs(points.min(0) + points.max(0) + 1 - inside.shape).max() <= 2
    assert (fatty.at(101, SIDE_M)[0] == WATER_MPS).all()


def test_the_tissue_holds_enclosed_water_and_no_other() -> None:
    speed = disc(41, 1450.0)
    region = tissue(speed)
    assert region[20, 20]
    assert (
        region.sum()
        == (speed != WATER_MPS).sum() + (np.hypot(*np.meshgrid(*(np.linspace(-1, 1, 41),) * 2)) < 0.1).sum()
    )
    assert not tissue(np.full((9, 9), WATER_MPS + 0.05)).any()


def test_errors_are_those_of_the_tissue_on_the_grid_of_the_benchmark() -> None:
    nodes = 241
    case = PublicCase("a case", disc(nodes, 1450.0), SIDE_M / (nodes - 1))
    assert scores(WATER_MPS, case).rmse == pytest.approx(50.0, abs=3.0)
    assert scores(mean_speed(case), case).rmse < scores(WATER_MPS, case).rmse
    shifted = image(disc(nodes, 1450.0) + 4.0, (-0.12, -0.12))
    errors = scores(shifted, case)
    assert errors.rmse == pytest.approx(4.0, abs=1e-6)
    assert errors.figures["MAE"] == pytest.approx(4.0, abs=1e-6)
    assert errors.figures["PCC"] == pytest.approx(1.0)
    assert 0.9 < errors.figures["SSIM"] < 1.0


def test_our_scans_have_a_finer_grid_than_any_inversion_and_their_waves_arrive_on_time() -> None:
    size = RingScan(0.03, 0.012, 2e5, 12, 2, (1440.0, 1575.0), WATER_MPS)
    assert 1440.0 / (1.54 * 2e5 * size.spacing_m) >= OWN_NODES_A_WAVE
    still = np.full((size.nodes, size.nodes), WATER_MPS)
    traces = size.recorded({"water": still}, lambda *_: None, threads=1)["water"]
    scan = size.dataset(traces, traces, still, None)
    assert traces.shape[:2] == (2, 12)
    assert not traces[0, 0].any(), "an element does not hear itself"
    # The envelope's maximum is one way through the water after that of the pulse, at time 0.
    own = scan.element_position_m
    for receiver in (3, 6):
        way = np.hypot(*(own[receiver] - own[scan.tx[0]]))
        late = np.argmax(np.abs(traces[0, receiver])) / size.rate_hz + scan.t0_s
        assert late == pytest.approx(way / WATER_MPS, abs=1.0 / size.centre_hz)


def test_the_page_shows_each_recorded_image(tmp_path: Path) -> None:
    row = {
        "target": "fatty, waveform: RMSE",
        "met": False,
        "figures": {"RMSE": 12.34, "MAE": 5.0, "SSIM": 0.81234, "PCC": None, "seconds": 61.4},
        "baselines": {"best constant": 30.0, "water alone": 41.0, "straight rays": 25.04},
    }
    (tmp_path / "rows.json").write_text(json.dumps([row, {"target": "fatty, waveform: time", "met": True}]))
    line = scoreboard(tmp_path / "rows.json").splitlines()[-1]
    assert line == "| fatty | waveform | **12.3** | 5.0 | 0.812 | none | 61 | 30.0 | 41.0 | 25.0 |"
