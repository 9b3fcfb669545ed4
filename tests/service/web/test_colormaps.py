"""The colour maps of the page are the tables of Matplotlib, as in the images that the service draws."""

import json

import numpy as np
from matplotlib import colormaps

from bentray_service.routes.pages import WEB
from bentray_workers.images.slice_style import COLORMAPS


def test_the_tables_are_those_of_matplotlib():
    tables = json.loads((WEB / "static" / "viewer" / "colormaps.json").read_text())
    assert set(tables) == {*COLORMAPS, "RdBu_r"}
    for name, table in tables.items():
        computed = np.frombuffer(bytes.fromhex(table), np.uint8)
        expected = colormaps[name](np.arange(256), bytes=True)[:, :3]
        np.testing.assert_array_equal(computed.reshape(256, 3), expected, err_msg=name)
