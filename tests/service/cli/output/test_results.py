"""What offsets, blurs or doubts an image is printed before its figures."""

import numpy as np
import pytest

from bentray_kernels.acquisition import Dataset
from bentray_kernels.tomography import Reconstruction, Settings
from bentray_service.cli.output.results import show_results, write_results


def test_a_caution_about_the_uncertainty_is_printed_first(
    tmp_path, capsys: pytest.CaptureFixture[str]
) -> None:
    angles = 2.0 * np.pi * np.arange(8) / 8
    ring = 0.1 * np.column_stack((np.cos(angles), np.sin(angles)))
    scan = Dataset(ring, np.arange(8), np.arange(8), 1500.0, delta_tof_s=np.zeros((8, 8)))
    speed = np.full((16, 16), 1500.0)
    result = Reconstruction(
        speed,
        np.ones_like(speed),
        (0.01, 0.01),
        (0.0, 0.0),
        1500.0,
        Settings(),
        provenance={"uncertainty": "They may be too small."},
    )
    found = write_results(tmp_path, result, scan, 1.0, draw=lambda: b"")
    show_results("Reconstruction", found, as_json=False)
    assert capsys.readouterr().out.startswith("They may be too small.\n")
