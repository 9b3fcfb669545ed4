"""Cost of a simulated scan: memory of its tasks, CPU time, size of its file."""

from __future__ import annotations

from bentray_kernels.acquisition.simulation.volume_scan import AXIAL_MARGIN_NODES
from bentray_kernels.wave.memory import padded_nodes
from bentray_kernels.wave.points import REACH

from ..cluster.capacities import MIB, REAL
from .plane import SimulationSettings
from .volume import VolumeSimulationSettings
from .waves import WaveSimulationSettings

Timed = SimulationSettings | VolumeSimulationSettings

# Python's own part of any task.
FLOOR_BYTES = 18 * MIB

# Bytes per node of the fine grid: media, sampling of one of them, and a marching front; of the padded grid
# of a wave: both media while they are made, and two fields.
PLANE_BYTES, SPACE_BYTES, WAVE_BYTES = 96, 96, 88

# Bytes per pair while the file is written: times, losses, and their noise.
PAIR_BYTES, LOSS_BYTES, NOISE_BYTES = 20, 12, 16

# Seconds on a core of 2020: per node of a medium, without and with attenuation; per node of a wave front;
# per padded node of the media of a wave, and per node and time step in 2-D and 3-D; per byte of a file.
MEDIUM_S, LOSSY_MEDIUM_S, FRONT_S, WAVE_MEDIUM_S, BYTE_S = 3e-6, 1.4e-5, 4e-7, 1.5e-5, 2e-8
STEP_S = {2: 1e-9, 3: 2.1e-9}

# Of a task with several emitters.
TASK_S = 1.0
MAX_EMITTERS = 64


def fine_nodes(settings: Timed) -> int:
    """Nodes of the grid that one wave front crosses."""
    side = settings.refinement * (settings.nodes - 1) + 1
    if isinstance(settings, VolumeSimulationSettings) and settings.three_d:
        return side**2 * ((settings.slices - 1 + 2 * AXIAL_MARGIN_NODES) * settings.refinement + 1)
    return side**2


def emitters_a_task(settings: Timed) -> int:
    """Emitters that take about ``TASK_S``."""
    return max(1, min(MAX_EMITTERS, int(TASK_S / (FRONT_S * fine_nodes(settings)))))


def task_bytes(settings: Timed | WaveSimulationSettings) -> dict[str, int]:
    """Memory of each kind of task beyond that of a warm worker, bytes.

    Returns:
        By function: ``make_part`` and ``write_scan``.
    """
    if isinstance(settings, WaveSimulationSettings):
        traces = settings.elements * settings.samples
        arrays = _grid_bytes(settings) + _trace_bytes(settings)
        written = 6 * REAL * traces + 8 * settings.emissions * settings.elements
        truth = PLANE_BYTES * settings.nodes**2
    else:
        in_space = isinstance(settings, VolumeSimulationSettings)
        marched = isinstance(settings, VolumeSimulationSettings) and settings.three_d
        arrays = (SPACE_BYTES if marched else PLANE_BYTES) * fine_nodes(settings)
        each = PAIR_BYTES + LOSS_BYTES * settings.attenuation + NOISE_BYTES * _noisy(settings)
        written = each * pairs(settings)
        heights = settings.slices if isinstance(settings, VolumeSimulationSettings) else 1
        truth = (SPACE_BYTES if in_space else PLANE_BYTES) * settings.nodes**2 * heights
    return {"make_part": FLOOR_BYTES + arrays, "write_scan": FLOOR_BYTES + written + truth}


def costly_setting(settings: Timed | WaveSimulationSettings, task: str) -> str:
    """The setting with the largest effect on the memory of a task."""
    if task == "write_scan":
        return "elements"
    if isinstance(settings, WaveSimulationSettings):
        return "elements" if _trace_bytes(settings) > _grid_bytes(settings) else "frequency_hz"
    return "nodes"


def result_bytes(settings: Timed | WaveSimulationSettings) -> int:
    """Bytes of the arrays in the file, before compression."""
    if isinstance(settings, WaveSimulationSettings):
        return 2 * 4 * settings.emissions * settings.elements * settings.samples
    return REAL * pairs(settings) * (1 + settings.attenuation + _noisy(settings))


def cpu_seconds(settings: Timed | WaveSimulationSettings) -> tuple[float, float]:
    """Seconds of all tasks without media, and of the media that each worker makes for itself."""
    packing = BYTE_S * result_bytes(settings)
    if isinstance(settings, WaveSimulationSettings):
        steps = settings.samples * settings.skip * settings.emissions
        # Each element is interpolated from the nodes around it.
        moved = _padded(settings) + settings.elements * (2 * REACH) ** settings.dimensions
        waves = 2 * STEP_S[settings.dimensions] * moved * steps
        return waves + packing, WAVE_MEDIUM_S * _padded(settings)
    nodes, media = fine_nodes(settings), len({settings.medium_number(k) for k in range(settings.scans)})
    sampled = LOSSY_MEDIUM_S if settings.attenuation else MEDIUM_S
    fronts = FRONT_S * nodes * settings.scans * settings.emitters
    return fronts + packing, sampled * nodes * media


def pairs(settings: Timed) -> int:
    """Number of pairs of all scans."""
    return settings.scans * settings.emitters**2


def _grid_bytes(settings: WaveSimulationSettings) -> int:
    return WAVE_BYTES * _padded(settings)


def _trace_bytes(settings: WaveSimulationSettings) -> int:
    """Every time step in both media, and the recorded samples."""
    return (2 * REAL * settings.skip + 8) * settings.elements * settings.samples


def _noisy(settings: Timed) -> bool:
    return settings.snr is not None or (isinstance(settings, SimulationSettings) and settings.noise_s > 0.0)


def _padded(settings: WaveSimulationSettings) -> int:
    return padded_nodes(settings.grid, settings.edge_nodes)
