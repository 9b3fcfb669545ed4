"""A volume stored as an upload leaves it, without the process that reads it."""

from bentray_kernels.phantoms import ONE_HOLE, sampled
from bentray_service.rows.ids import LOCAL, new_id
from bentray_workers.files.volume import Volume, write_volume


def store_volume(http, values=None, spacing=(1e-3,) * 3):
    """Store it for the tenant of the service, by default a ball with a hole; returns its id."""
    state, volume_id = http.app.state, new_id("volume")
    volume = Volume.from_values(sampled(ONE_HOLE, 12) if values is None else values, spacing)
    write_volume(state.stores.files.of(LOCAL).volume(volume_id), volume)
    summary = {
        "title": "a ball",
        "shape": list(volume.values.shape),
        "spacing_m": list(spacing),
        "origin_m": [0.0] * 3,
        "value_range": list(volume.range()),
    }
    state.stores.volumes.uploaded.add(LOCAL, volume_id, size=1, sha256="0" * 64, summary=summary)
    return volume_id
