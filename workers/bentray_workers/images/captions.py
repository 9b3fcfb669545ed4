"""Captions: quantities, slice, and method of a reconstruction."""

import math

from bentray_kernels.tomography import Reconstruction, Settings
from bentray_kernels.tomography.solver_choice import solver_of

from ..files.quantities import QUANTITIES

LABELS = {name: quantity.label for name, quantity in QUANTITIES.items()}
NAMES = {name: quantity.title for name, quantity in QUANTITIES.items()}


def slice_caption(result: Reconstruction, index: int) -> str:
    """``, slice index 2 (0 to 4), z = 6.0 mm``; empty for a 2-D image."""
    if result.speed.ndim == 2:
        return ""
    text = f", slice index {index} (0 to {result.speed.shape[2] - 1})"
    if math.isfinite(result.spacing_m[2]):
        text += f", z = {1e3 * (result.origin_m[2] + index * result.spacing_m[2]):.1f} mm"
    return text


def facts(result: Reconstruction) -> str:
    """Rays, method, iterations, size, water and residual in one line."""
    settings = _of_rays(result)
    size = " by ".join(str(n) for n in result.speed.shape)
    sentences = [
        _rays(settings),
        {"sart": "SART", "gauss-newton": "Gauss-Newton"}[settings.method],
        f"{size} nodes of {1e3 * result.spacing_m[0]:.2g} mm",
        f"water {result.water_speed_mps:.1f} m/s",
    ]
    if result.settings.method == "waveform":
        sentences.insert(2, "then waveforms")
    if result.residual_rms_s is not None:
        sentences.insert(-2, _iterations(result))
        sentences.append(f"residual {1e9 * result.residual_rms_s:.0f} ns")
    return "  ·  ".join(sentences)


def _of_rays(result: Reconstruction) -> Settings:
    """Settings of the ray-based image; after a full-waveform refinement those of the first trial."""
    if result.settings.method != "waveform" or not result.trials:
        return result.settings
    return result.settings.changed(**result.trials[0].settings)


def stage_names(result: Reconstruction) -> tuple[str, ...]:
    """Names of the stages of ``tomography.grid_schedule`` and of frequency bands; empty for one stage."""
    settings = _of_rays(result)
    nodes = settings.nodes or result.speed.shape[0]
    grids = [-(-nodes // 2**k) for k in range(settings.numerics.coarser_grids, -1, -1)]
    names = [f"{nodes} nodes" for nodes in grids]
    bands = {
        sweep.stage: "attenuation" if sweep.of_attenuation else f"{1e-3 * sweep.band_hz[1]:.0f} kHz"
        for sweep in result.history
        if sweep.band_hz
    }
    names += [name for _, name in sorted(bands.items())]
    return tuple(names) if len(names) > 1 else ()


def _rays(settings: Settings) -> str:
    if settings.rays == "straight":
        return "straight rays"
    front = solver_of(settings, 3 if settings.decomposition == "volume" else 2).eikonal
    return f"bent rays ({front})"


def _iterations(result: Reconstruction) -> str:
    most: dict[int, int] = {}
    for sweep in result.history:
        most[sweep.stage] = max(most.get(sweep.stage, 0), sweep.sweep)
    count = sum(most.values())
    text = f"{count} iteration{'s' if count != 1 else ''}"
    return text if len(most) == 1 else f"{text} in {len(most)} stages"
