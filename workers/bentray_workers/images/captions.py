"""The words of the pictures: quantities, which slice is shown, how it was made."""

from __future__ import annotations

import math

from bentray_kernels.tomography import Reconstruction

LABELS = {
    "speed": "sound speed (m/s)",
    "coverage": "ray length per node (m)",
    "attenuation": "attenuation (Np/m)",
}
NAMES = {"speed": "Sound speed", "coverage": "Coverage", "attenuation": "Attenuation"}


def which_slice(result: Reconstruction, index: int) -> str:
    """``, slice index 2 (0 to 4), z = 6.0 mm``; nothing for a plain image."""
    if result.speed.ndim == 2:
        return ""
    text = f", slice index {index} (0 to {result.speed.shape[2] - 1})"
    if math.isfinite(result.spacing_m[2]):
        text += f", z = {1e3 * (result.origin_m[2] + index * result.spacing_m[2]):.1f} mm"
    return text


def facts(result: Reconstruction) -> str:
    """Rays, method, sweeps, size, water and residual in one line."""
    settings = result.settings
    rays = "straight rays" if settings.rays == "straight" else f"curved rays ({settings.eikonal})"
    size = " by ".join(str(n) for n in result.speed.shape)
    found = [
        rays,
        {"sart": "SART", "gauss-newton": "Gauss-Newton"}[settings.method],
        f"{size} nodes of {1e3 * result.spacing_m[0]:.2g} mm",
        f"water {result.water_speed_mps:.1f} m/s",
    ]
    if result.residual_rms_s is not None:
        last = max(s.sweep for s in result.history)
        found.insert(2, f"{last} sweep{'s' if last != 1 else ''}")
        found.append(f"residual {1e9 * result.residual_rms_s:.0f} ns")
    return "  ·  ".join(found)
