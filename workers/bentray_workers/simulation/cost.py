"""Size of a simulated scan: its tasks, CPU time and file, from counts of nodes, pairs and samples."""

from __future__ import annotations

from bentray_kernels.acquisition.simulation.volume_scan import AXIAL_MARGIN_NODES
from bentray_kernels.wave.memory import padded_nodes
from bentray_kernels.wave.points import REACH

from ..cluster.capacities import REAL
from ..cluster.task_costs import FIXED, TaskSize
from .plane import SimulationSettings
from .volume import VolumeSimulationSettings
from .waves import WaveSimulationSettings

Timed = SimulationSettings | VolumeSimulationSettings

# Of a task with several emitters: seconds per node of a wave front on a core of 2020. Parts of stored jobs
# are numbered by it, so it does not change with the table of task costs.
FRONT_S, TASK_S = 4e-7, 1.0
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


def task_sizes(settings: Timed | WaveSimulationSettings) -> dict[str, TaskSize]:
    """Size of ``make_part`` and of ``write_scan``, whose worker still keeps the media."""
    if isinstance(settings, WaveSimulationSettings):
        samples = settings.elements * settings.samples
        kind, counts = (
            "simulated waves",
            {
                "padded nodes": padded_nodes(settings.grid, settings.edge_nodes),
                "samples of an emission": samples,
                "time steps of an emission": samples * settings.skip,
                "nodes of the truth": settings.nodes**2,
            },
        )
    else:
        # Media of two scans are kept.
        nodes = fine_nodes(settings) * min(2, _media(settings))
        kind, counts = (
            "simulated times",
            {
                "nodes of media": nodes,
                "nodes of media with losses": nodes * settings.attenuation,
                "pairs": pairs(settings),
                "pairs with losses": pairs(settings) * settings.attenuation,
                "pairs with noise": pairs(settings) * _noisy(settings),
                "nodes of the truth": settings.nodes**2 * getattr(settings, "slices", 1),
            },
        )
    return dict.fromkeys(("make_part", "write_scan"), TaskSize(kind, counts))


def costly_setting(settings: Timed | WaveSimulationSettings) -> str:
    """The setting with the largest effect on the memory of a task."""
    parts = task_sizes(settings)["make_part"].parts
    name = max(parts, key=lambda name: 0 if name == FIXED else parts[name])
    if name.startswith(("pairs", "samples", "time steps")):
        return "elements"
    return "frequency_hz" if name == "padded nodes" else "nodes"


def result_bytes(settings: Timed | WaveSimulationSettings) -> int:
    """Bytes of the arrays in the file, before compression."""
    if isinstance(settings, WaveSimulationSettings):
        return 2 * 4 * settings.emissions * settings.elements * settings.samples
    return REAL * pairs(settings) * (1 + settings.attenuation + _noisy(settings))


def cpu_seconds(settings: Timed | WaveSimulationSettings) -> tuple[float, float]:
    """Seconds of all tasks without media, and of the media that each worker makes for itself."""
    parts = work_of(settings).parts_s
    media = sum(parts.pop(name, 0.0) for name in ("nodes of media", "nodes of media with losses"))
    return sum(parts.values()), media


def work_of(settings: Timed | WaveSimulationSettings) -> TaskSize:
    """All tasks on one worker, for their CPU time."""
    counts: dict[str, float] = {"bytes of the file": result_bytes(settings)}
    if isinstance(settings, WaveSimulationSettings):
        nodes, media = padded_nodes(settings.grid, settings.edge_nodes), 2
        # Each element is interpolated from the nodes around it.
        moved = nodes + settings.elements * (2 * REACH) ** settings.dimensions
        steps = settings.samples * settings.skip * settings.emissions
        kind, work = f"waves of a scan in {settings.dimensions}-D", {"steps of nodes": 2 * moved * steps}
    else:
        nodes, media = fine_nodes(settings), _media(settings)
        kind, work = "times of a scan", {"nodes of wave fronts": nodes * settings.scans * settings.emitters}
    lossy = isinstance(settings, Timed) and settings.attenuation
    counts |= {"nodes of media": nodes * media, "nodes of media with losses": nodes * media * lossy}
    return TaskSize(kind, counts | work)


def pairs(settings: Timed) -> int:
    """Number of pairs of all scans."""
    return settings.scans * settings.emitters**2


def _media(settings: Timed) -> int:
    return len({settings.medium_number(scan) for scan in range(settings.scans)})


def _noisy(settings: Timed) -> bool:
    return settings.snr is not None or (isinstance(settings, SimulationSettings) and settings.noise_s > 0.0)
