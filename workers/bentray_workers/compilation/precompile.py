"""Compile the kernels of all kinds of jobs, for an image.

Run it as ``python -m bentray_workers.compilation.precompile``. Numba compiles at the first call, so that
each kind of job is run once on the smallest scan that has all it needs. A worker's own start (``warmup``)
does less: what is compiled here is loaded when it is first called.
"""

from __future__ import annotations

import sys
import tempfile
import warnings
from collections.abc import Iterator
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from bentray_kernels.acquisition import PICKERS, Dataset, Waveform
from bentray_kernels.meshes.example_surfaces import bumpy_ball
from bentray_kernels.phantoms import ONE_HOLE, sampled
from bentray_kernels.splines import FILTERS
from bentray_kernels.tomography import Settings
from bentray_kernels.tomography.settings import DECOMPOSITIONS, PENALTIES

from ..cluster.task_pool import ThreadTasks
from ..files.dataset import write_dataset
from ..files.mesh import StoredMesh, write_mesh
from ..files.volume import Volume
from ..reconstruction import quality_report as quality
from ..reconstruction.reconstruction_run import reconstruct
from ..rendering import geometry_field
from ..rendering.field_settings import FieldSettings
from ..rendering.refraction import strip
from ..rendering.refraction_view import RefractionView
from ..rendering.scene_cache import build, filtered_of
from ..simulation.plane import SimulationSettings, simulate
from ..simulation.volume import VolumeSimulationSettings, simulate_volume
from ..simulation.volume_waves import VolumeWaveSettings
from ..simulation.waves import WaveSimulationSettings, simulate_emission, simulate_waves
from . import warmup
from .cache_misses import compiled_kernels

# Along a side of every image.
NODES = 24

TIMES = SimulationSettings(nodes=16, elements=16, coupling_mps=1375.0, attenuation=True)
HEIGHTS = VolumeSimulationSettings(nodes=32, slices=2, elements=8, refinement=4, coupling_mps=1375.0)
SPACE = replace(HEIGHTS, refinement=2, three_d=True)
WAVES = WaveSimulationSettings(frequency_hz=2e5, side_m=0.05, elements=24, emissions=12, nodes=32)
WAVES_IN_SPACE = VolumeWaveSettings(frequency_hz=1e5, side_m=0.03, elements=8, emissions=1, nodes=16)


def of_times() -> Iterator[dict[str, Any]]:
    """The settings of reconstructions from travel times and amplitudes."""
    yield {"resolution_check": True}
    yield {"rays": "straight", "reciprocity": False}
    yield {"eikonal": "accurate", "speed_update": "data-driven", "speed_range_mps": (1300.0, 1600.0)}
    yield {"method": "auto"}
    for rays, penalty in product(("curved", "straight"), PENALTIES):
        yield {"method": "gauss-newton", "rays": rays, "penalty": penalty}
    yield {"method": "gauss-newton", "ray_width_m": 5e-3}


def of_heights() -> Iterator[dict[str, Any]]:
    """The same of several slices."""
    for method, decomposition in product(("sart", "gauss-newton"), DECOMPOSITIONS):
        yield {"method": method, "decomposition": decomposition, "attenuation": False}


def of_traces() -> Iterator[dict[str, Any]]:
    """The same of recorded waves."""
    for picker in PICKERS:
        yield {"picker": picker, "attenuation": False}
    yield {"guided_rounds": 1, "amplitudes": "ratio", "focusing": True}
    yield {"amplitudes": "spectrum"}
    yield {"method": "waveform", "wave_bands": 1, "wave_emitters": 4}


def digitised(scan: Dataset) -> Dataset:
    """A scan with traces of 16-bit integers, as scanners have them."""
    traces = scan.waveform
    assert traces is not None
    assert traces.water is not None
    pair = (traces.object, traces.water)
    step = max(float(np.abs(one).max()) for one in pair) / np.iinfo(np.int16).max
    both = [(one / step).round().astype(np.int16) for one in pair]
    return replace(scan, waveform=Waveform(both[0], both[1], scale=step))


def compile_all(folder: Path) -> None:
    """Run each kind of job once; ``folder`` is for its files."""
    warmup.warm_up()
    warmup.warm_up_rendering()
    warmup.warm_up_tracing()
    simulate_emission(WAVES_IN_SPACE, 0)
    waves = simulate_waves(None, WAVES)
    scans: tuple[tuple[Dataset, Iterator[dict[str, Any]]], ...] = (
        (simulate(None, TIMES), of_times()),
        (simulate_volume(None, HEIGHTS), of_heights()),
        (simulate_volume(None, SPACE), of_heights()),
        (waves, of_traces()),
        (digitised(waves), of_traces()),
    )
    for number, (scan, wanted) in enumerate(scans):
        path = folder / f"scan-{number}.h5"
        write_dataset(path, scan)
        quality.quality_report(path, "aic")
        for settings in wanted:
            reconstruct(None, path, Settings(nodes=NODES, sweeps=1, **settings))
    _glass()
    _field(folder)


def _glass() -> None:
    """A ball through every filter, refracted and lit, with both kinds of supersampling."""
    volume = Volume.of(sampled(ONE_HOLE, 12), (1e-3,) * 3)
    views = (
        RefractionView(iso=(0.5,), supersampling="prss", degree=2, width=8, height=8),
        RefractionView(iso=(0.5,), supersampling="real", degree=2, width=8, height=8),
        RefractionView(iso=(0.5,), mode="shaded", supersampling="none", width=8, height=8),
    )
    for name in FILTERS:
        filtered = filtered_of(volume, name, 0.0)
        for view in views:
            chosen = replace(view, filter=name)
            strip(build(filtered, chosen.layers()), chosen, 0, 8)


def _field(folder: Path) -> None:
    """A mesh laid out, its tables and its image."""
    mesh, work = folder / "mesh.h5", folder / "field-work"
    write_mesh(mesh, StoredMesh(bumpy_ball(320)))
    work.mkdir()
    settings = FieldSettings(samples=4, inner_samples=4, divisions=4, image_size=33)
    geometry_field.build(
        ThreadTasks(),
        mesh,
        settings,
        folder / "field",
        work,
        on_progress=lambda progress: None,
        on_saved=lambda: None,
        stop=lambda: False,
    )


def main() -> None:
    """For the build of an image."""
    warnings.simplefilter("ignore")
    with compiled_kernels() as kernels, tempfile.TemporaryDirectory() as folder:
        compile_all(Path(folder))
    sys.stdout.write(f"{len(kernels)} kernels compiled\n")


if __name__ == "__main__":
    main()
