"""Fast sweeping by subdomains in one process, in the order of the tasks of a cluster."""

import math

import numpy as np

from bentray_kernels.eikonal.subdomains import cut, face_of, neighbours, opposite, sides, sweep_block


def solve_by_blocks(problem, blocks, tolerance=1e-12):
    """Travel times, (nx, ny[, nz]), s, from blocks that exchange faces until they agree."""
    shape = problem.slowness.shape
    boxes = cut(shape, blocks)
    start = np.full(problem.padded_slowness.size, math.inf)
    seeds, times = problem.seeds()
    start[seeds] = times
    time = problem.interior(start)
    held: dict = {}
    for place in boxes:
        held[place] = [None for _ in sides(len(shape))]
    seeded = [place for place, box in boxes.items() if (time[box] < math.inf).any()]
    waiting = set(seeded)
    # Seeds at a face are news to the block beyond.
    for place in seeded:
        for side, beyond in neighbours(place, boxes):
            held[beyond][opposite(side)] = face_of(time[boxes[place]], sides(len(shape))[side]).copy()
            waiting.add(beyond)
    while waiting:
        sent = {
            place: sweep_block(
                problem.slowness[boxes[place]], time[boxes[place]], held[place], problem.spacing, tolerance
            )
            for place in sorted(waiting)
        }
        waiting = set()
        for place, swept in sent.items():
            time[boxes[place]] = swept.times
            for side, beyond in neighbours(place, boxes):
                if swept.changed[side]:
                    held[beyond][opposite(side)] = swept.faces[side]
                    waiting.add(beyond)
    return time
