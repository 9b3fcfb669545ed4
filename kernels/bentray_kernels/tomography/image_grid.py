"""Nodes of the image where the settings leave them open: from aperture, elements, wavelength and noise."""

import math

# Nodes lie half an element's pitch apart, the finest detail that the rays of a ring sample, and never closer
# than half a wavelength, which rays cannot resolve.
PITCHES = 0.5
WAVELENGTHS = 0.5

# A node of this contrast must change the mean time of as many rays as there are elements by its noise.
CONTRAST = 0.03

# Limits of an automatic grid, and of one in 3-D, whose cost grows with the cube. Multiples of ``STEP``.
MIN_NODES, MAX_NODES, MAX_NODES_3D, STEP = 96, 256, 128, 8


def automatic_nodes(
    side_m: float,
    pitch_m: float,
    wavelength_m: float | None,
    noise_s: float = 0.0,
    water_mps: float = 1500.0,
    elements: int = 1,
    *,
    volume: bool = False,
) -> tuple[int, str]:
    """Nodes along each side of an image, and why so many.

    Args:
        side_m: of the image, or the width of the array, m.
        pitch_m: of the elements, m; see ``element_pitch``.
        wavelength_m: in water, m; None if the frequency is unknown.
        noise_s: standard deviation of the travel times, s; 0: unknown, or irrelevant beside the wavelength.
        water_mps: speed of sound in water, m/s.
        elements: number of elements.
        volume: whether the image is one of 3-D.
    """
    finest, what = max(
        (PITCHES * pitch_m, "half the pitch of the elements"),
        (WAVELENGTHS * (wavelength_m or 0.0), "half a wavelength"),
        (noise_s * water_mps / (CONTRAST * math.sqrt(elements)), "as far as noisy times show details"),
    )
    most = MAX_NODES_3D if volume else MAX_NODES
    needed = side_m / finest if finest > 0.0 else math.inf
    # Not a number for arrays without width.
    if not needed < most:
        return most, "the most of an automatic grid"
    nodes = STEP * math.ceil(needed / STEP)
    if nodes < MIN_NODES:
        return MIN_NODES, "the fewest of an automatic grid"
    return nodes, f"{1e3 * finest:.3g} mm apart: {what}"
