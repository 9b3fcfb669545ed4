"""The figures of a result: errors against a known truth, and an honest word on where they were read."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bentray_kernels.acquisition import Dataset, Truth
from bentray_kernels.tomography import Reconstruction, Settings, Sweep
from bentray_service.cli.figures import errors, figures, summary

WATER = 1500.0
STEP = 1e-3


def image(speed: np.ndarray, origin: tuple[float, ...] = (0.0, 0.0)) -> Reconstruction:
    return Reconstruction(
        speed=speed,
        coverage=np.ones_like(speed),
        spacing_m=(STEP,) * speed.ndim,
        origin_m=origin,
        water_speed_mps=WATER,
        settings=Settings(nodes=16),
    )


def truth(speed: np.ndarray, spacing: float = STEP) -> Truth:
    axes = ",".join("xyz"[: speed.ndim])
    return Truth(speed, (spacing,) * speed.ndim, (0.0,) * speed.ndim, axes=axes)


def disc(nodes: int = 17) -> np.ndarray:
    """Water with a square of 1450 and 1550 m/s in it."""
    speed = np.full((nodes, nodes), WATER)
    speed[4:9, 4:13], speed[9:13, 4:13] = 1450.0, 1550.0
    return speed


@given(st.floats(-40.0, 40.0))
def test_a_constant_error_is_read_as_it_is(offset: float) -> None:
    found = errors(image(disc() + offset), truth(disc()))
    assert found["rmse_mps"] == pytest.approx(abs(offset), abs=1e-9)
    assert found["mean_absolute_error_of_range"] == pytest.approx(abs(offset) / 100.0, abs=1e-9)
    assert found["true_range_mps"] == [1450.0, 1550.0]
    assert found["region_nodes"] == 81


def test_errors_in_the_water_do_not_count() -> None:
    speed = disc()
    speed[0, 0] += 500.0
    assert errors(image(speed), truth(disc()))["rmse_mps"] == 0.0


def test_the_region_of_the_file_is_used_and_named() -> None:
    roi = np.zeros((17, 17), dtype=bool)
    roi[0:2, 0:2] = True
    found = errors(image(disc() + 3.0), truth(disc()), roi)
    assert found["region"] == "mask/roi of the file"
    assert found["region_nodes"] == 4
    assert found["mean_absolute_error_of_range"] is None, "water alone has no range to divide by"
    assert found["rmse_mps"] == pytest.approx(3.0)


def test_a_truth_that_is_water_throughout_is_compared_everywhere() -> None:
    found = errors(image(np.full((17, 17), WATER + 2.0)), truth(np.full((17, 17), WATER)))
    assert found["region"] == "every node that the truth covers"
    assert found["region_nodes"] == 17 * 17


def test_a_finer_truth_is_read_at_the_nodes_of_the_image() -> None:
    ramp = 1500.0 + np.add.outer(np.arange(33), 2 * np.arange(33)) * 5.0
    found = errors(image(ramp[::2, ::2]), truth(ramp, STEP / 2))
    assert found["rmse_mps"] == pytest.approx(0.0, abs=1e-9)


def test_x_and_y_are_not_exchanged() -> None:
    assert errors(image(disc().T), truth(disc()))["rmse_mps"] > 10.0


def test_a_truth_on_axes_y_x_is_turned() -> None:
    turned = replace(truth(disc().T), axes="y,x")
    assert errors(image(disc()), turned)["rmse_mps"] == 0.0


def test_several_slices_are_compared_with_a_solid_truth() -> None:
    solid = np.stack([disc(), np.full((17, 17), WATER), disc()[::-1]], axis=-1)
    found = errors(image(solid + 2.0, (0.0,) * 3), truth(solid))
    assert found["rmse_mps"] == pytest.approx(2.0)
    assert errors(image(solid[..., ::-1], (0.0,) * 3), truth(solid))["rmse_mps"] > 10.0


def test_what_cannot_be_compared_is_said() -> None:
    away = errors(image(disc(), origin=(1.0, 1.0)), truth(disc()))
    assert away["region"] == "not compared: no node of the image lies within the truth"
    solid = errors(image(np.full((17, 17, 2), WATER), (0.0,) * 3), truth(disc()))
    assert solid["region"].startswith("not compared: the truth, on axes 'x,y', must be registered")
    display = replace(truth(disc()), axes="as displayed")
    assert errors(image(disc()), display) == {
        "region": "not compared: the truth, on axes 'as displayed', must be registered with the image first",
        "region_nodes": 0,
    }
    uneven = replace(image(np.full((17, 17, 2), WATER), (0.0,) * 3), spacing_m=(STEP, STEP, math.nan))
    assert "rmse_mps" not in errors(uneven, truth(np.full((17, 17, 2), WATER)))


def dataset(known: Truth | None) -> Dataset:
    ring = np.array([[0.0, 0.0], [0.016, 0.0], [0.0, 0.016]])
    everyone = np.arange(3)
    return Dataset(ring, everyone, everyone, WATER, delta_tof_s=np.zeros((3, 3)), truth=known)


def test_the_residual_is_that_of_the_last_sweep_over_all_slices() -> None:
    history = (Sweep(0, 1, 9e-7, 3), Sweep(1, 1, 9e-7, 3), Sweep(0, 2, 3e-7, 3), Sweep(1, 2, 4e-7, 3))
    found = figures(replace(image(disc()), history=history), dataset(None), 1.25)
    assert found["residual_rms_s"] == pytest.approx(math.sqrt((9 + 16) / 2) * 1e-7)
    assert len(found["history"]) == 4
    assert found["truth"] is None
    assert found["seconds"] == 1.25
    assert found["speed_range_mps"] == [1450.0, 1550.0]
    assert Settings(**found["settings"]) == Settings(nodes=16)


def test_the_summary_tells_the_errors_and_their_region_only_with_a_truth() -> None:
    without = dict(summary(figures(image(disc()), dataset(None), 1.0)))
    assert not {"rms error", "errors read", "residual, last sweep"} & set(without)
    with_truth = dict(summary(figures(image(disc() + 10.0), dataset(truth(disc())), 1.0)))
    assert with_truth["rms error"] == "10.0 m/s"
    assert with_truth["mean absolute error"] == "10.0 % of the range"
    assert with_truth["errors read"] == "the outline of what is not water in the truth"
