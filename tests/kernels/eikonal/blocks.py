"""Fast sweeping by subdomains in one process, in the order of the tasks of a cluster."""

import numpy as np

from bentray_kernels.eikonal.subdomains import Block, cut, neighbours, opposite, sides


def solve_by_blocks(problem, blocks, tolerance=1e-12):
    """Travel times, (nx, ny[, nz]), s, from blocks that exchange faces until they agree."""
    shape = problem.slowness.shape
    boxes = cut(shape, blocks)
    seeded = np.full(problem.padded_slowness.size, np.inf)
    nodes, times = problem.seeds()
    seeded[nodes] = times
    seeded = problem.interior(seeded)
    swept, sent, arrived, waiting = {}, {}, {}, set()
    for place, box in boxes.items():
        seeds = {tuple(node): seeded[box][tuple(node)] for node in np.argwhere(seeded[box] < np.inf)}
        swept[place] = Block(problem.slowness[box], problem.spacing, seeds)
        sent[place] = None
        arrived[place] = [None for _ in sides(len(shape))]
        if seeds:
            waiting.add(place)
    while waiting:
        for place in sorted(waiting):
            sent[place] = swept[place].sweep(arrived[place], sent[place], tolerance)
            arrived[place] = [None for _ in sides(len(shape))]
        done, waiting = waiting, set()
        for place in sorted(done):
            for side, beyond in neighbours(place, boxes):
                if sent[place].changed[side]:
                    arrived[beyond][opposite(side)] = sent[place].faces[side]
                    waiting.add(beyond)
    time = np.empty(shape)
    for place, box in boxes.items():
        time[box] = swept[place].times()
    return time
