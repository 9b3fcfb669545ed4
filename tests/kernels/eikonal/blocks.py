"""Fast sweeping by subdomains in one process, in the order of the tasks of a cluster."""

import numpy as np

from bentray_kernels.eikonal.subdomains import Block, cut, neighbours, opposite, sides


def solve_by_blocks(problem, blocks, tolerance=1e-12):
    """Travel times, (nx, ny[, nz]), s, from blocks that exchange halos until convergence."""
    shape = problem.slowness.shape
    boxes = cut(shape, blocks)
    seeded = np.full(problem.padded_slowness.size, np.inf)
    nodes, times = problem.seeds()
    seeded[nodes] = times
    seeded = problem.interior(seeded)
    swept, sent_halo, arrived, waiting = {}, {}, {}, set()
    for index, box in boxes.items():
        seeds = {tuple(node): seeded[box][tuple(node)] for node in np.argwhere(seeded[box] < np.inf)}
        swept[index] = Block(problem.slowness[box], problem.spacing, seeds)
        sent_halo[index] = None
        arrived[index] = [None for _ in sides(len(shape))]
        if seeds:
            waiting.add(index)
    while waiting:
        for index in sorted(waiting):
            sent_halo[index] = swept[index].sweep(arrived[index], sent_halo[index], tolerance)
            arrived[index] = [None for _ in sides(len(shape))]
        done, waiting = waiting, set()
        for index in sorted(done):
            for side, beyond in neighbours(index, boxes):
                if sent_halo[index].changed[side]:
                    arrived[beyond][opposite(side)] = sent_halo[index].faces[side]
                    waiting.add(beyond)
    time = np.empty(shape)
    for index, box in boxes.items():
        time[box] = swept[index].times()
    return time
