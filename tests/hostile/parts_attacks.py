"""Attacks on the parts of a deployment: kills of each amid a job and an upload, a disk that is full."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from bentray_kernels.acquisition import Dataset, pick
from bentray_kernels.tomography import Settings, reconstruct
from bentray_kernels.tomography.stored_settings import from_stored
from bentray_workers.files.dataset import write_dataset
from bentray_workers.files.reconstruction import read_reconstruction

from .. import small_disk
from ..faults import test_checkpoint_damage, test_full_disk, test_kills, test_uploads
from ..faults.machine import Machine, wait_until
from ..kernels.tomography.waveform.scans import scan as traces
from .attack_table import Attack

SART = {"nodes": 64, "method": "sart", "iterations": 60, "attenuation": {"enabled": False}}
WAVEFORM = {"method": "waveform", "nodes": 24, "iterations": 1, "minutes": 0.01}


def parts_attacks(machine: Machine, scan: Dataset, scan_file: Path, folder: Path) -> list[Attack]:
    """All of them; tests of faults that exist are run as they are."""
    bits = "the bits of an undisturbed run"
    return [
        Attack("SIGKILL of the scheduler amid a job", bits, lambda: scheduler(machine, scan, scan_file)),
        Attack(
            "SIGKILL of service, a worker and scheduler amid a waveform job",
            bits,
            lambda: waveform(machine, folder),
        ),
        Attack(
            "SIGKILL amid a simulation of waves",
            "goes on from its parts, the same bytes",
            _test(
                lambda: test_kills.test_simulation_resumes_from_finished_emissions(
                    machine, _new(folder, "waves")
                )
            ),
        ),
        Attack(
            "a bit of the newest checkpoint flipped",
            "the one before, the same bits",
            _test(
                lambda: (
                    test_checkpoint_damage.test_the_newest_checkpoint_is_flipped_while_the_service_is_dead(
                        machine, scan, scan_file
                    )
                )
            ),
        ),
        Attack(
            "SIGKILL amid an upload and while it is read",
            "goes on at its offset",
            _test(lambda: test_uploads.test_upload_survives_a_service_kill(_new(folder, "upload"))),
        ),
        Attack(
            "disk full amid a job", "waits, then the same bits", lambda: full_disk(folder, scan, scan_file)
        ),
    ]


def scheduler(machine: Machine, scan: Dataset, scan_file: Path) -> str:
    job = machine.submit(machine.upload(scan_file), **SART)
    wait_until(lambda: machine.job(job)["progress"]["done"] > 0)
    machine.restart("scheduler")
    ended = machine.ended(job)
    assert ended["state"] == "succeeded", ended["error"]
    found = read_reconstruction(machine.files / "volumes" / f"{ended['volume']}.h5")
    assert np.array_equal(found.speed, reconstruct(scan, from_stored(SART)).speed)
    return f"succeeded after {test_kills.attempts_of(machine, job)} attempts, the same bits"


def waveform(machine: Machine, folder: Path) -> str:
    path = folder / "traces.h5"
    write_dataset(path, traces())
    job = machine.submit(machine.upload(path), **WAVEFORM)
    kills = 0
    for part in ("service", "a worker", "scheduler"):
        wait_until(lambda: machine.job(job)["progress"]["done"] > 0)
        time.sleep(1.0)
        if machine.job(job)["state"] != "running":
            break
        if part == "a worker":
            machine.kill_a_worker()
        else:
            machine.restart(part)
        machine.wait_ready()
        kills += 1
    assert kills, "the job was too short"
    ended = machine.ended(job)
    assert ended["state"] == "succeeded", ended["error"]
    found = read_reconstruction(machine.files / "volumes" / f"{ended['volume']}.h5")
    picked = replace(pick(traces()), waveform=traces().waveform)
    expected = reconstruct(picked, Settings.of(**{"method": "sart", **WAVEFORM}))
    assert np.array_equal(found.speed.squeeze(), expected.speed)
    return f"succeeded after {kills} kills, the same bits"


def full_disk(folder: Path, scan: Dataset, scan_file: Path) -> str:
    disk = _new(folder, "small-disk")
    with small_disk.mounted(disk):
        test_full_disk.test_a_job_waits_for_room(_new(folder, "full"), disk, scan, scan_file)
    return "as expected"


def _test(attempt: Callable[[], None]) -> Callable[[], str]:
    def run() -> str:
        attempt()
        return "as expected"

    return run


def _new(folder: Path, name: str) -> Path:
    made = folder / name
    made.mkdir()
    return made
