"""Standard deviations of a small volume, reconstructed in 3-D, beside the truth."""

from dataclasses import replace

import numpy as np
from scipy.ndimage import gaussian_filter

from bentray_kernels.tomography import Settings, reconstruct
from bentray_service.cli.output.benchmark_context import BenchmarkContext
from bentray_service.cli.output.benchmark_row import Row
from bentray_workers.simulation.simulation_run import simulate
from bentray_workers.simulation.volume import VolumeSimulationSettings

from ..reconstruction.reconstruction_volume import COUPLING_MPS, inner
from ._judged_image import row_of

NODES, SLICES, ELEMENTS, SNR = 24, 6, 24, 30.0

# A node whose true speed differs from that of the coupling by more than this is in the object, m/s.
DIFFERENT_MPS = 1.0


def small_volume(context: BenchmarkContext, goal: float) -> Row:
    """Nodes of the phantom of Table 7 within two deviations; it chose nothing."""
    asked = VolumeSimulationSettings(
        NODES, SLICES, ELEMENTS, COUPLING_MPS, refinement=2, three_d=True, array="moved", snr=SNR
    )
    with context.cluster() as cluster:
        scan = simulate(
            asked, lambda p: context.progress(p.done, p.total, "simulating in space"), cluster.client
        )
    truth = scan.truth
    assert truth is not None
    settings = Settings.from_values(
        method="gauss-newton",
        decomposition="volume",
        nodes=NODES,
        side_m=asked.scan().side_m,
        uncertainty=True,
        attenuation=False,
    )
    result = reconstruct(scan, settings)
    assert result.uncertainty is not None
    deviation = inner(replace(result, speed=result.uncertainty), SLICES).speed
    width = result.resolution_width_m[0] / result.spacing_m[0]
    smooth = gaussian_filter(truth.sound_speed_mps, width, mode="nearest")
    inside = (np.abs(truth.sound_speed_mps - COUPLING_MPS) > DIFFERENT_MPS) & (deviation > 0.0)
    error, deviation = np.abs(inner(result, SLICES).speed - smooth)[inside], deviation[inside]
    about = f"{NODES}² by {SLICES} nodes, {ELEMENTS} elements at each height, SNR {SNR:g}"
    return row_of("U1 small volume in 3-D", error, deviation, goal, about)
