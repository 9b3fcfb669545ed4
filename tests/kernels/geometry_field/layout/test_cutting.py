"""Cuts grow as trees, to where a flat layout would shrink the surface."""

from itertools import islice

import numpy as np
import pytest

from bentray_kernels.geometry_field.layout.cutting import Cutter
from bentray_kernels.meshes.example_surfaces import bumpy_ball, sphere, torus
from bentray_kernels.meshes.opening import cut_open
from bentray_kernels.meshes.topology import topology_of

from ...meshes.examples import ball_with_holes, flat_patch, mesh, two_handles, without


@pytest.mark.parametrize(
    "surface",
    [
        bumpy_ball(500),
        torus(9, 7),
        two_handles(),
        ball_with_holes(),
        without(torus(12, 10), [3, 77]),
        flat_patch(height=lambda x, y: np.cos(x) * np.sin(y)),
    ],
    ids=["ball", "torus", "two handles", "holes", "torus with holes", "patch"],
)
def test_a_grown_cut_leaves_a_disk(surface):
    topology = topology_of(surface.faces)
    cutter = Cutter(surface, topology)
    cut = cutter.first()
    for end in islice(cutter.far_ends(cut), 5):
        before = cut
        cut = cutter.grown(cut, end.vertex)
        assert (cut.edges >= before.edges).all()
        assert cut.vertices[end.vertex]
        opened = topology_of(cut_open(topology, cut.edges).faces)
        assert (opened.euler, opened.genus, len(opened.boundary_loops)) == (1, 0, 1)


def test_a_cut_takes_the_shortest_way():
    patch = flat_patch(9, 9)
    cutter = Cutter(patch, topology_of(patch.faces))
    cut = cutter.first()
    middle, nearer = 4 * 9 + 4, 4 * 9 + 6
    grown = cutter.grown(cutter.grown(cut, middle), nearer)
    # From the middle four edges to the boundary, and from the other vertex two, whatever the way.
    assert cutter.lengths[grown.edges].sum() == pytest.approx(6.0)


def test_the_first_end_is_the_tip_of_a_spike():
    ball = bumpy_ball(2000)
    tip = int(np.argmax(ball.vertices[:, 0]))
    spiked = ball.vertices.copy()
    near = np.linalg.norm(spiked - spiked[tip], axis=1)
    spiked[:, 0] += 3.0 * np.exp(-((near / 0.25) ** 2))
    cutter = Cutter(mesh(spiked, ball.faces), topology_of(ball.faces))
    first = cutter.first()
    ends = [*np.flatnonzero(first.vertices), *(end.vertex for end in islice(cutter.far_ends(first), 2))]
    assert min(np.linalg.norm(spiked[end] - spiked[tip]) for end in ends) < 0.3


def test_ends_do_not_repeat_and_run_out():
    ball = sphere(6, 7)
    cutter = Cutter(ball, topology_of(ball.faces))
    first = cutter.first()
    listed = list(cutter.far_ends(first))
    ends = [end.vertex for end in listed]
    assert listed[0].scale > 3.0 > listed[-1].scale > 1e-3
    assert 10 < len(ends) == len(set(ends)) < len(ball.vertices)
    assert not set(ends) & set(np.flatnonzero(first.vertices).tolist())


def test_flat_surfaces_need_no_cut_end():
    patch = flat_patch()
    cutter = Cutter(patch, topology_of(patch.faces))
    assert list(cutter.far_ends(cutter.first())) == []
    assert not cutter.first().edges.any()
