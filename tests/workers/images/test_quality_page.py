"""The quality page: its panels and text, also for scans without traces or times."""

from dataclasses import replace

import numpy as np
import pytest

from bentray_kernels.acquisition import Waveform
from bentray_kernels.acquisition.quality import examine
from bentray_workers.images.quality_page import quality_png

from ...kernels.acquisition.traces import blob_delay, scan


def panels(figures) -> list[str]:
    return [axes.get_title(loc="left") for axes in figures[-1].axes if axes.get_title(loc="left")]


def test_page_lists_the_findings(drawn):
    dataset = scan(blob_delay(16), elements=16, noise=0.01)
    dataset.waveform.object[:, 3] = dataset.waveform.water[:, 3] = 0.0
    png = quality_png(replace(dataset, title="Ring $7"), examine(dataset))
    assert png.startswith(b"\x89PNG")
    assert panels(drawn)[0].startswith("Object, emission ")
    assert panels(drawn)[2] == "Object minus water"
    words = " ".join(" ".join(drawn.words()).split())
    assert "Quality of Ring $7: usable" in words
    assert "dead elements: 1 without a pulse in reception (3). Left out." in words
    assert "dead elements: 16" in words, "the legend counts pairs"


@pytest.mark.parametrize("kind", ["times", "refused", "slices"])
def test_every_scan_has_a_page(undrawn, kind):
    dataset = scan(blob_delay(12), elements=12)
    if kind == "times":
        dataset = replace(examine(dataset).picked, waveform=None)
    elif kind == "refused":
        dataset = replace(dataset, center_frequency_hz=None)
    else:
        both = (np.stack([t, t]) for t in (dataset.waveform.object, dataset.waveform.water))
        dataset = replace(dataset, slice_z_m=np.array([0.0, 0.01]), waveform=Waveform(*both))
    index = 0 if kind == "slices" else None
    assert quality_png(dataset.slice(0), examine(dataset), index).startswith(b"\x89PNG")
    words = " ".join(undrawn.words())
    expected = {"times": "no object traces", "refused": "centre frequency: none", "slices": "slice 0"}[kind]
    assert expected in words


def test_the_same_scan_gives_the_same_page():
    dataset = scan(blob_delay(12), elements=12)
    assert quality_png(dataset, examine(dataset)) == quality_png(dataset, examine(dataset))
