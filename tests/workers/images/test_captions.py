"""Captions of pictures: stages and iterations."""

from dataclasses import replace

import numpy as np
import pytest

from bentray_kernels.acquisition import Dataset
from bentray_kernels.tomography import Candidate, Iteration, Settings
from bentray_kernels.tomography.grid_schedule import stages
from bentray_workers.images.captions import facts, stage_names

from ..files.reconstructions import made


@pytest.mark.parametrize(
    "settings",
    [
        Settings.from_values(method="sart", nodes=100, coarser_grids=2),
        Settings.from_values(method="sart", nodes=99, coarser_grids=2, rays="straight"),
    ],
)
def test_captions_name_the_stages(settings):
    ring, everyone = np.array([[0.0, 0.0], [0.1, 0.0], [0.0, 0.1]]), np.arange(3)
    plans = stages(Dataset(ring, everyone, everyone, 1500.0, delta_tof_s=np.zeros((3, 3))), settings)
    names = [f"{plan.nodes} nodes" for plan in plans]
    assert list(stage_names(replace(made(), settings=settings))) == names


def test_one_stage_needs_no_name():
    assert stage_names(replace(made(), settings=Settings(method="sart"))) == ()


def test_the_sweeps_of_all_stages_are_counted():
    history = (
        Iteration(0, 1, 2e-7, 4),
        Iteration(0, 2, 1e-7, 4),
        Iteration(0, 1, 1e-7, 4, 1),
        Iteration(1, 1, 1e-7, 4, 1),
    )
    assert "3 iterations in 2 stages" in facts(replace(made(slices=2), history=history))
    assert "  1 iteration  " in facts(replace(made(), history=history[:1]))


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        (Settings(method="sart", rays="straight"), "straight rays  "),
        (Settings(method="sart"), "bent rays (deviation)"),
        (Settings.from_values(method="sart", eikonal="fsm"), "bent rays (fsm)"),
        (Settings(method="gauss-newton"), "bent rays (accurate)"),
        (Settings(method="sart", decomposition="volume"), "bent rays (accurate)"),
    ],
)
def test_the_wave_front_method_is_the_one_that_was_used(settings, words):
    assert facts(replace(made(), settings=settings)).startswith(words)


def test_waveforms_are_named_after_the_rays_that_they_began_with():
    bands = (
        Iteration(0, 1, 1e-7, 36, 1, band_hz=(1e5, 2e5), misfit=0.1),
        Iteration(0, 1, 5e-8, 36, 3, band_hz=(1e5, 4.5e5), misfit=0.1),
        Iteration(0, 1, 5e-8, 24, 4, band_hz=(3e5, 4.5e5), misfit=0.1, of_attenuation=True),
    )
    rays = Candidate({"rays": "straight", "method": "sart"}, 1e-7, 1e-7)
    result = replace(
        made(),
        settings=Settings(method="waveform", nodes=128),
        trials=(rays,),
        history=(Iteration(0, 1, 2e-7, 36), *bands),
    )
    assert facts(result).startswith(
        "straight rays  ·  SART  ·  then waveforms  ·  4 iterations in 4 stages  ·  24 by"
    )
    assert stage_names(result) == ("128 nodes", "200 kHz", "450 kHz", "attenuation")


def test_a_refined_image_names_the_rays_of_the_chosen_candidate():
    trial = Candidate({"method": "gauss-newton", "rays": "curved", "ray_width_m": 0.003}, 1e-7, 1e-7)
    refined = replace(made(), settings=Settings(method="waveform"), trials=(trial,))
    assert "Gauss-Newton  ·  then waveforms" in facts(refined)
