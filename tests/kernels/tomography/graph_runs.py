"""Runs of task graphs: in a random order, or lost and resumed from checkpoints."""

import json

from bentray_kernels.tomography.checkpoint import pack, unpack


def run_in_random_order(graph, rng, most=None):
    """Run tasks one at a time in a random order, to the end or until ``most`` tasks have run."""
    tasks = graph.first()
    while tasks and most != 0:
        task = tasks.pop(rng.randrange(len(tasks)))
        tasks += graph.after(task, task.function(*task.arguments))
        most = None if most is None else most - 1
    return graph


def stored(graph, *types):
    """Its checkpoint, written to JSON and arrays and read again."""
    tree, arrays = pack(graph.checkpoint)
    return unpack(json.loads(json.dumps(tree)), [array.copy() for array in arrays], *types)


def run(make, cuts=(), *types):
    """Run a graph; before each task whose number is in ``cuts`` it is lost and restored.

    Returns:
        The graph at its end, and how many tasks have run.
    """
    graph = make()
    ready, done = graph.first(), 0
    while ready:
        if done in cuts:
            checkpoint = stored(graph, *types)
            graph = make()
            graph.restore(checkpoint)
            ready = graph.first()
        done += 1
        task = ready.pop(0)
        ready += graph.after(task, task.function(*task.arguments))
    return graph, done
