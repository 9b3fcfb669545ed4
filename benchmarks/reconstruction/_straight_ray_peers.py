"""CGLS, SIRT and SART along straight rays, in plain NumPy and SciPy as a laboratory writes them."""

import math

import numpy as np
from scipy.sparse import csr_array, diags_array, eye_array, kron, vstack
from scipy.sparse.linalg import lsqr

from ._travel_times import TravelTimes

# Samples of a straight ray a node's spacing.
SAMPLES = 2

# Strength of the roughness in CGLS: of 0.0001, 0.00035, 0.001, 0.0035 and 0.01 the one with the least error.
CGLS_ROUGHNESS = 0.0035
CGLS_STEPS = 500

# Both end with the sweep that takes less than this part off the misfit. SART's relaxation is the best of
# 0.03, 0.1, 0.3 and 1; SIRT converges below 2.
SIRT_RELAXATION, SIRT_SWEEPS, SIRT_LEAST_GAIN = 1.9, 200, 0.002
SART_RELAXATION, SART_SWEEPS, SART_LEAST_GAIN = 0.03, 20, 0.05


def straight_matrix(times: TravelTimes) -> csr_array:
    """Lengths of straight rays, m, shared bilinearly among the nodes: (pairs, nodes in the region)."""
    inside = np.flatnonzero(times.region)
    number = np.full(times.region.size, -1)
    number[inside] = np.arange(inside.size)
    emitter, receiver = times.pairs()
    return csr_array(
        vstack(
            [
                _fan(times, times.emitters[index], times.receivers[receiver[emitter == index]], number)
                for index in np.unique(emitter)
            ],
            format="csr",
        )
    )


def _fan(times: TravelTimes, start: np.ndarray, ends: np.ndarray, number: np.ndarray) -> csr_array:
    """Rows of one emitter; ``number`` is the column of a node, -1 outside the region."""
    length = np.linalg.norm(ends - start, axis=1)
    count = math.ceil(SAMPLES * length.max() / times.spacing)
    fraction = (np.arange(count) + 0.5) / count
    points = (start + fraction[:, None] * (ends - start)[:, None, :]) / times.spacing
    low = points.astype(int)
    beyond = points - low
    row = np.repeat(np.arange(len(ends)), count)
    rows, columns, values = [], [], []
    for corner in np.ndindex(2, 2):
        weight = np.where(corner, beyond, 1.0 - beyond).prod(axis=-1) * (length / count)[:, None]
        node = (low + corner) @ (times.region.shape[1], 1)
        column = number[node].ravel()
        kept = column >= 0
        rows.append(row[kept])
        columns.append(column[kept])
        values.append(weight.ravel()[kept])
    shape = (len(ends), int(number.max()) + 1)
    return csr_array((np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))), shape=shape)


def roughness(times: TravelTimes, strength: float) -> csr_array:
    """Differences of neighbours in the region, weighted: (edges, nodes in the region), m.

    The sum of squared differences is the integral of the squared gradient, whatever the spacing; times the
    number of pairs and the square of the image's side it compares with a sum of squared times.
    """
    region = times.region
    down, across = (_differences(count) for count in region.shape)
    every = vstack((kron(down, eye_array(region.shape[1])), kron(eye_array(region.shape[0]), across)))
    every = csr_array(every)
    inside = region.ravel()
    whole = abs(every) @ inside.astype(float) == 2.0
    rows = np.isfinite(times.delta_tof).sum()
    return csr_array(every[whole][:, inside] * (strength * math.sqrt(rows) * times.side_m))


def _differences(count: int) -> csr_array:
    unit = np.ones(count - 1)
    return csr_array(diags_array([-unit, unit], offsets=[0, 1], shape=(count - 1, count)))


def cgls(times: TravelTimes) -> np.ndarray:
    """Conjugate gradients for least squares, with roughness; SciPy's ``lsqr`` has the same iterates."""
    matrix = straight_matrix(times)
    rough = roughness(times, CGLS_ROUGHNESS)
    data = np.concatenate((times.delta_tof[times.pairs()], np.zeros(rough.shape[0])))
    system = vstack((matrix, rough), format="csr")
    return times.speed(lsqr(system, data, atol=1e-4, btol=1e-4, iter_lim=CGLS_STEPS)[0])


def sirt(times: TravelTimes) -> np.ndarray:
    """All rays at once: residuals over the lengths of the rays, updates over the lengths at the nodes."""
    return _sweeps(times, [np.arange(len(times.pairs()[0]))], SIRT_RELAXATION, SIRT_SWEEPS, SIRT_LEAST_GAIN)


def sart(times: TravelTimes) -> np.ndarray:
    """The method ``sirt`` with an update after each emitter, in random order."""
    emitter, _ = times.pairs()
    fans = [np.flatnonzero(emitter == index) for index in np.unique(emitter)]
    return _sweeps(times, fans, SART_RELAXATION, SART_SWEEPS, SART_LEAST_GAIN)


def _sweeps(
    times: TravelTimes, blocks: list[np.ndarray], relaxation: float, sweeps: int, least_gain: float
) -> np.ndarray:
    matrix = straight_matrix(times)
    measured = times.delta_tof[times.pairs()]
    systems = []
    for rows in blocks:
        block = csr_array(matrix[rows])
        weights = _reciprocal(block.sum(axis=1)), _reciprocal(block.sum(axis=0))
        systems.append((block, csr_array(block.T), *weights, measured[rows]))
    change = np.zeros(matrix.shape[1])
    random = np.random.default_rng(0)
    last = math.inf
    for _ in range(sweeps):
        squares = 0.0
        for k in random.permutation(len(systems)):
            block, back, of_rays, of_nodes, wanted = systems[k]
            residual = wanted - block @ change
            squares += float(residual @ residual)
            change += relaxation * of_nodes * (back @ (of_rays * residual))
        if squares > (1.0 - least_gain) ** 2 * last:
            break
        last = squares
    return times.speed(change)


def _reciprocal(sums: np.ndarray) -> np.ndarray:
    return np.divide(1.0, sums, out=np.zeros_like(sums), where=sums > 0.0)
