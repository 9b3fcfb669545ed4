"""Ranges of the settings of simulated scans; those of some kinds of scan are narrower."""

from bentray_kernels.requests.ranges import Range

NODES = Range(16, 1024)
ELEMENTS = Range(3, 4096)
SLICES = Range(2, 1024)
EMISSIONS = Range(1, 4096)
# Emitting elements by default, of as many or more.
DEFAULT_EMISSIONS = 64
# The memory grows with its square; more gains less than the noise of any scan.
REFINEMENT = Range(2, 64)
SNR = Range(1e-6, 1e12)
NOISE_S = Range(0.0, 1.0, below=True, unit="s")
FREQUENCY_HZ = Range(1e4, 1e7, unit="Hz")
SIDE_M = Range(1e-3, 1.0, unit="m")
