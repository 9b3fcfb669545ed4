"""A volume stored as an upload leaves it, without the process that reads it."""

import math

from bentray_kernels.phantoms import ONE_HOLE, sampled
from bentray_service.rows.ids import LOCAL, new_id
from bentray_workers.files.volume import Volume, write_volume


def store_volume(http, values=None, spacing=(1e-3,) * 3, tenant=LOCAL, shape=None):
    """Store a ball with a hole, or these values,; its row may have another shape. Returns its id."""
    state, volume_id = http.app.state, new_id("volume")
    volume = Volume.from_values(sampled(ONE_HOLE, 12) if values is None else values, spacing)
    write_volume(state.stores.files.of(tenant).volume(volume_id), volume)
    shape = list(shape or volume.values.shape)
    summary = {
        "title": "a ball",
        "shape": shape,
        "spacing_m": list(spacing),
        "origin_m": [0.0] * 3,
        "value_range": list(volume.range()),
    }
    size = 4 * math.prod(shape)
    state.stores.volumes.uploaded.add(tenant, volume_id, size=size, sha256="0" * 64, summary=summary)
    return volume_id
