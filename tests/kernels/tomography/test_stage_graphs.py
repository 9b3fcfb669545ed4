"""Stage graphs: batches of SART grow to the duration of a task."""

from bentray_kernels.tomography.stage_graphs import next_batch


def test_batches_aim_at_the_time_of_a_task():
    assert next_batch(8, 8, 0.5) == 8
    assert next_batch(8, 8, 0.25) == 16
    assert next_batch(8, 8, 0.001) == 32
    assert next_batch(8, 8, 60.0) == 1
    assert next_batch(8, -3, 0.1) == 8
