"""Plans of turntables: more of anything is more work, and workers with too little memory are refused."""

import json
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bentray_kernels.errors import InvalidInput
from bentray_workers.cluster.capacities import MIB, WorkerCapacity
from bentray_workers.rendering.turntable import Turntable, TurntableGraph
from bentray_workers.rendering.turntable_planning import plan_turntable

WORKER = WorkerCapacity(1024 * MIB, ("recon", "render"))
SHAPE = (64, 48, 32)


@given(st.sampled_from(["frames", "width", "height", "depth"]), st.integers(1, 64))
def test_more_of_anything_is_more_work(field, by):
    asked = Turntable(frames=10, width=200, height=300)
    more = replace(asked, **{field: getattr(asked, field) + by})
    before, after = (plan_turntable(SHAPE, one, [WORKER]) for one in (asked, more))
    assert after.work_s > before.work_s
    assert after.tasks >= before.tasks
    assert plan_turntable(SHAPE, asked, [WORKER] * 4).work_s < before.work_s
    assert json.loads(json.dumps(before.to_dict()))["largest_bytes"] == max(before.call_bytes.values())


def test_rays_cost_as_the_picture_has_them():
    whole, half, lit = (
        plan_turntable(SHAPE, Turntable(**one), [WORKER])
        for one in ({"ray_spacing": 1}, {"ray_spacing": 2}, {"mode": "shaded"})
    )
    assert whole.work_s / half.work_s == pytest.approx(4.0, rel=0.05)
    assert lit.work_class != whole.work_class == half.work_class
    assert lit.work_s < whole.work_s


def test_the_tasks_are_those_of_the_graph(tmp_path):
    asked = Turntable(frames=5, width=1024, height=1024)
    graph = TurntableGraph(tmp_path / "volume.h5", asked, tmp_path / "target", tmp_path)
    drawing = graph.first()
    # Each frame is written after its tiles, and the file after all frames.
    assert plan_turntable(SHAPE, asked, ()).tasks == len(drawing) + asked.frames + 1


def test_too_little_memory_is_refused():
    small = WorkerCapacity(300 * MIB, ("recon", "render"))
    with pytest.raises(InvalidInput, match="volume") as refusal:
        plan_turntable((512, 512, 512), Turntable(), [small])
    assert "bytes" in str(refusal.value)
    assert plan_turntable((512, 512, 512), Turntable(), ()).workers == 0
