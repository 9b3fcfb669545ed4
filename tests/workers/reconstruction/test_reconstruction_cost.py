"""The counted work of a reconstruction: it grows with what there is to do, and workers share it."""

from dataclasses import replace

import pytest

from bentray_kernels.tomography import Settings
from bentray_workers.files.dataset.counts import Summary, Traces
from bentray_workers.reconstruction.reconstruction_cost import OVERHEAD_S, reconstruction_cost

RING = Summary(64, 64, 64 * 64, 1, False, 0.0, 0.16, 0, False)
TRACES = Traces(64, 64, 2000, 4, 8e6, 4e5, 1500.0)

# Deviations are a part of their own.
DEFAULTS = {"method": "sart", "nodes": 64, "decomposition": "slices", "uncertainty": False}


def seconds(scan=RING, workers=1, **asked):
    settings = Settings.from_values(**{**DEFAULTS, **asked})
    return reconstruction_cost(scan, settings, workers).seconds - OVERHEAD_S


@pytest.mark.parametrize("method", ["sart", "gauss-newton", "auto"])
def test_more_work_takes_longer(method):
    base_s = seconds(method=method)
    assert base_s > 0.0
    # The candidates of auto are compared on 64 nodes in both cases.
    assert seconds(method=method, nodes=128) > (1.5 if method == "auto" else 2.0) * base_s
    assert seconds(method=method, iterations=10) == pytest.approx(2.0 * base_s)
    assert seconds(replace(RING, emitters=128), method=method) == pytest.approx(2.0 * base_s)
    assert seconds(replace(RING, receivers=128), method=method) > base_s
    assert seconds(method=method, rays="straight") < base_s
    assert seconds(method=method, resolution_check=True) > base_s
    assert seconds(method=method, uncertainty=True) > base_s


def test_methods_in_the_order_of_their_cost():
    assert seconds() < seconds(method="gauss-newton") < seconds(method="auto")
    # The candidates of auto are compared in one slice alone.
    many = replace(RING, slices=10)
    assert seconds(many, method="gauss-newton") == pytest.approx(10.0 * seconds(method="gauss-newton"))
    assert seconds(many, method="auto") < 10.0 * seconds(method="auto")


def test_workers_share_what_can_be_shared():
    many = replace(RING, slices=4)
    assert seconds(many, 4) == pytest.approx(seconds(many) / 4.0)
    # SART takes one emitter of a slice after the other.
    assert seconds(RING, 4) == seconds(RING, 1)
    assert seconds(many, 8) == seconds(many, 4)
    assert seconds(RING, 4, method="gauss-newton") == pytest.approx(seconds(method="gauss-newton") / 4.0)
    assert seconds(RING, 0) == seconds(RING, 1)


def test_waves_and_picking_add_their_time():
    traced = replace(RING, traces=TRACES)
    picked = replace(traced, recorded=TRACES, traces_bytes=2 * 64 * 64 * 2000 * 4)
    assert seconds(picked) > seconds(traced) == seconds(RING)
    plain = seconds(traced, method="auto")
    refined = seconds(traced, method="auto", minutes=30.0)
    assert plain < seconds(traced, method="auto", minutes=1.0) <= refined
    # The budget is one of CPU time: it bounds what is added.
    assert refined - plain <= 30.0 * 60.0
    assert seconds(traced, method="waveform") >= refined


def test_classes_keep_apart_what_differs_in_speed():
    def name(scan=RING, **asked):
        settings = Settings.from_values(**{"method": "sart", "nodes": 64, "decomposition": "slices", **asked})
        return reconstruction_cost(scan, settings, 1).work_class

    traced = replace(RING, traces=TRACES)
    names = [
        name(),
        name(rays="straight"),
        name(method="gauss-newton"),
        name(method="auto"),
        name(eikonal="fsm"),
        name(decomposition="volume"),
        name(traced, method="auto", minutes=30.0),
        name(replace(traced, traces_bytes=1)),
        name(replace(RING, period=True), method="auto"),
    ]
    assert len(set(names)) == len(names)
    # How much there is to do is no matter of class.
    assert name(nodes=128, iterations=9) == name(replace(RING, emitters=9)) == name()
    # Without traces there are no waves, whatever the budget.
    assert name(method="auto", minutes=30.0) == name(method="auto")


@pytest.mark.parametrize("asked", [{"decomposition": "volume"}, {"eikonal": "fim"}])
def test_speeds_that_nobody_measured_are_not_known(asked):
    settings = Settings.from_values(method="sart", nodes=64, decomposition="slices")
    assert reconstruction_cost(RING, settings, 1).speed_known
    assert not reconstruction_cost(RING, settings.changed(**asked), 1).speed_known
