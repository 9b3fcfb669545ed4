"""Head to head: judge of the images, rows without peers, and waves of deepwave."""

from dataclasses import replace

import numpy as np
import pytest
from benchmarks.reconstruction._deepwave_peer import ricker, simulation
from benchmarks.reconstruction.head_to_head import METHODS, NODES, at_truth, compared, on_square
from benchmarks.reconstruction.reconstruction_peers import Found, timed

from bentray_kernels.acquisition import Truth

from .._small_ring import ELEMENTS, WATER_MPS, dataset

INSIDE = np.hypot(*np.meshgrid(*2 * [np.linspace(-1.0, 1.0, NODES)])) < 0.7
SPEED = np.where(INSIDE, 1450.0, WATER_MPS) + 5.0 * np.sign(np.arange(NODES) - 63.5)
SCAN = replace(dataset(), roi=INSIDE, truth=Truth(SPEED, 2 * (0.12 / (NODES - 1),), 2 * (-0.06,)))


def test_images_on_any_grid_are_judged_over_the_breast() -> None:
    for speed, error in ((SPEED, 0.0), (np.full((50, 50), 1450.0), 5.0)):
        found = timed(lambda speed=speed: at_truth(on_square(speed), SCAN.truth), SCAN)
        assert found.rmse_mps == pytest.approx(error, abs=1e-9)


def test_a_missing_peer_has_its_reason_in_place_of_a_figure() -> None:
    results = {name: Found(3.0, 2.0, 1.0) for name in METHODS if name != "deepwave"}
    rows = {row.target: row for row in compared(results, {"deepwave": "not here"}, SCAN)}
    assert rows["H1 pyGIMLi: rms error"].met
    assert rows["H1 Bentray auto: rms error"].goal == 3.0
    assert rows["H1 Bentray waveform: rms error"].goal == rows["H1 pyGIMLi: rms error"].goal
    assert rows["H1 deepwave: rms error"].value is None
    assert "not here" in rows["H1 deepwave: rms error"].detail


def test_the_page_names_code_that_is_not_there(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend("docs")
    from from_code.head_to_head import definitions

    assert definitions("# Why.\nA, B = 1, 2\nC = 3\n", ("B",)) == ["# Why.\nA, B = 1, 2"]
    with pytest.raises(KeyError, match="D: not defined"):
        definitions("B = 1", ("B", "D"))


def test_waves_of_deepwave_arrive_on_time() -> None:
    torch, _ = map(pytest.importorskip, ("torch", "deepwave"))
    scan = replace(dataset(), tx=np.array([3]), delta_tof_s=None, sampling_rate_hz=1e6)
    simulate = simulation(torch, scan, 0.2, 0.002, 5e4)
    traces = simulate(torch.full((101, 101), WATER_MPS), torch.tensor(ricker(5e4, 1e-6, 250))[None].float())
    assert traces.shape == (1, ELEMENTS, 250)
    far, near = (traces[0, (3 + step) % ELEMENTS].abs().argmax().item() for step in (12, 6))
    assert 1e-6 * (far - near) == pytest.approx(0.17 * (1.0 - 0.5**0.5) / WATER_MPS, abs=1.5e-6)
