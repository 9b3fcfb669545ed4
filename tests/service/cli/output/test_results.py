"""Offsets, blur and doubts of an image are printed before its figures."""

import numpy as np
import pytest

from bentray_kernels.acquisition import Dataset
from bentray_kernels.tomography import Caution, Reconstruction, Settings
from bentray_kernels.tomography.result import CHECK
from bentray_service.cli.output.exit_codes import DoubtfulResult, end_doubtful
from bentray_service.cli.output.results import show_results, write_results


def test_a_doubt_is_the_first_line_and_other_cautions_follow(
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
        cautions=(Caution("bounds", "Cut off.", doubtful=True), Caution("uncertainty", "May be too small.")),
        provenance={"water": "Water of 20 °C is assumed."},
    )
    written = write_results(tmp_path, result, scan, 1.0, draw=lambda: b"")
    show_results("Reconstruction", written, as_json=False)
    lines = [f"Doubtful result. Cut off. {CHECK}", "Water of 20 °C is assumed.", "May be too small."]
    assert capsys.readouterr().out.splitlines()[:3] == lines
    with pytest.raises(DoubtfulResult, match="the result is doubtful"):
        end_doubtful(1, 1, accepted=False)
    end_doubtful(1, 1, accepted=True)
    end_doubtful(0, 1, accepted=False)
