"""Readings of the data-driven speed update (Li 2008, 6.3, equation 6), from several initial images."""

from collections.abc import Callable, Iterable, Mapping
from unittest.mock import patch

import numpy as np

from bentray_kernels.tomography import Problem, Settings
from bentray_kernels.tomography.sart import sart_step, sart_update
from bentray_service.cli.output.benchmark_row import Row
from bentray_workers.simulation.plane import SimulationSettings
from bentray_workers.simulation.simulation_run import simulate

NODES, ELEMENTS, ITERATIONS, SEEDS = 64, 96, 4, 3

# Of the coupling, which is fat: the slower one of the dissertation's two possible couplings.
COUPLING_MPS = 1375.0

# Speeds of the initial image over that of the coupling. "SV values are small" in the early iterations (6.3).
STARTS = {"the coupling": 1.0, "1/1.3 of the coupling": 1.0 / 1.3, "half of the coupling": 0.5}

# Slowness beyond what an object may have, for initial images that are far off.
WIDE = (1.0 / 6000.0, 1.0 / 200.0)

# (slowness, region, whether it is not the first iteration) -> speed of the wave front.
Reading = Callable[[np.ndarray, np.ndarray, bool], np.ndarray]


def stretched(values: np.ndarray, where: np.ndarray, low: float, high: float) -> np.ndarray:
    """Values in a region mapped linearly from their own range to another one."""
    least, most = values[where].min(), values[where].max()
    result = values.copy()
    if most > least:
        result[where] = low + (values[where] - least) / (most - least) * (high - low)
    return result


def readings(inside: np.ndarray, low: float, high: float) -> Mapping[str, Reading]:
    """How equations 5 and 6 can be read; ``inside`` is the object, known only here."""

    def later(reading: Reading) -> Reading:
        return lambda slowness, region, warm: reading(slowness, region, warm) if warm else 1.0 / slowness

    def of_region(slowness: np.ndarray, region: np.ndarray, warm: bool) -> np.ndarray:
        return stretched(1.0 / slowness, region, low, high)

    return {
        "fixed": lambda slowness, region, warm: 1.0 / slowness,
        "from the first emitter": of_region,
        "from the second iteration (ours)": later(of_region),
        "range of the object alone": later(lambda s, region, warm: stretched(1.0 / s, inside, low, high)),
        "range of slowness": later(lambda s, region, warm: 1.0 / stretched(s, region, 1.0 / high, 1.0 / low)),
    }


def errors(phantom: str, seeds: int = SEEDS) -> dict[str, dict[str, list[float]]]:
    """Mean absolute errors in the object, % of its range: by initial image and reading, of each seed."""
    asked = SimulationSettings(
        phantom=phantom,  # type: ignore[arg-type]
        nodes=NODES,
        elements=ELEMENTS,
        coupling_mps=COUPLING_MPS,
    )
    dataset, scan = simulate(asked), asked.scan()
    inside, truth = scan.phantom.inside(NODES, scan.side_m), scan.phantom.speed(NODES, scan.side_m)
    low, high = scan.phantom.speed_range()
    errors: dict[str, dict[str, list[float]]] = {start: {} for start in STARTS}
    for seed in range(seeds):
        settings = Settings.from_values(
            method="sart",
            nodes=NODES,
            side_m=scan.side_m,
            iterations=ITERATIONS,
            speed_range_mps=(low, high),
            seed=seed,
        )
        problem = Problem.from_dataset(dataset, settings)
        for start, share in STARTS.items():
            for name, reading in readings(inside, low, high).items():

                def front(slowness, region, settings, *, warm, reading=reading):
                    return np.ascontiguousarray(reading(slowness, region, warm))

                slowness = np.full(problem.region.shape, 1.0 / COUPLING_MPS)
                slowness[problem.region] /= share
                state = sart_step.begin(slowness)
                with (
                    patch.object(sart_update, "propagation_speed", front),
                    patch.object(sart_update, "bounds_of", lambda settings: WIDE),
                ):
                    while not state.done:
                        state = sart_step.advance(problem, settings, state, ELEMENTS)
                error = 100.0 * np.abs(1.0 / state.slowness - truth)[inside].mean() / (high - low)
                errors[start].setdefault(name, []).append(float(error))
    return errors


def rows(seeds: int = SEEDS) -> Iterable[Row]:
    """The data-driven update from the first emitter over the fixed one; the other readings in the detail."""
    for phantom in ("table6", "table6-vertical"):
        for start, by_reading in errors(phantom, seeds).items():
            mean = {name: float(np.mean(values)) for name, values in by_reading.items()}
            listed = ", ".join(
                f"{name} {mean[name]:.2f} ± {np.std(values):.2f}" for name, values in by_reading.items()
            )
            yield Row(
                f"{phantom}, data-driven / fixed update, initial speed {start}",
                mean["from the first emitter"] / mean["fixed"],
                3.0 / 19.0,
                "<=",
                "",
                f"theirs 3 % over 19 %, initial image not told; % of the range, {seeds} orders of emitters: "
                f"{listed}; {NODES}² nodes, {ELEMENTS} elements, {ITERATIONS} iterations of SART",
            )
