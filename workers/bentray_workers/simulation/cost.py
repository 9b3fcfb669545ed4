"""Cost of a simulated scan: memory of its tasks, CPU time, size of its file."""

from bentray_kernels.acquisition.simulation.volume_scan import AXIAL_MARGIN_NODES
from bentray_kernels.wave.memory import padded_nodes
from bentray_kernels.wave.points import REACH

from ..cluster.capacities import REAL
from ..cluster.task_costs import Sizes, TaskSize
from .plane import SimulationSettings
from .volume import VolumeSimulationSettings
from .waves import WaveSimulationSettings

Timed = SimulationSettings | VolumeSimulationSettings

# Term of the memory of waves.
NODES = "padded nodes"

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


def task_sizes(settings: Timed | WaveSimulationSettings) -> Sizes:
    """What determines the memory of each kind of task, by function: ``make_part`` and ``write_scan``."""
    if isinstance(settings, WaveSimulationSettings):
        traces = settings.elements * settings.samples
        written = {"samples": traces, "pairs": settings.emissions * settings.elements}
        # The truth of a 3-D phantom is a section of its volume.
        written["images" if settings.dimensions == 2 else "a section"] = settings.nodes**2
        return {
            "make_part": TaskSize("make_part, waves", {NODES: _padded(settings), "samples": traces}),
            "write_scan": TaskSize("write_scan, waves", written),
        }
    heights = settings.slices if isinstance(settings, VolumeSimulationSettings) else 1
    written = {"pairs": pairs(settings), "nodes": settings.nodes**2 * heights}
    written["losses"] = settings.attenuation * pairs(settings)
    written["noise"] = _noisy(settings) * (1 + settings.attenuation) * pairs(settings)
    return {
        "make_part": TaskSize("make_part", {"nodes": fine_nodes(settings)}),
        "write_scan": TaskSize("write_scan", written),
    }


def costly_setting(settings: Timed | WaveSimulationSettings, task: str) -> str:
    """The setting with the largest effect on the memory of a task."""
    if task == "write_scan":
        return "elements"
    if isinstance(settings, WaveSimulationSettings):
        terms = task_sizes(settings)[task].terms
        return "frequency_hz" if max(terms, key=lambda term: terms[term]) == NODES else "elements"
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


def _noisy(settings: Timed) -> bool:
    return settings.snr is not None or (isinstance(settings, SimulationSettings) and settings.noise_s > 0.0)


def _padded(settings: WaveSimulationSettings) -> int:
    return padded_nodes(settings.grid, settings.edge_nodes)
