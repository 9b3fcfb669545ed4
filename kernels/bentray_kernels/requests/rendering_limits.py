"""Limits of refractive renderings and geometry fields, free of compiled code."""

# Samples of a geometry field along an edge of the cube, and of the textures of reference. Those of the
# dissertation end at 24, where the table of reference takes 96 MB; at 48 a table has 191 million entries, and
# that of reference 1.5 GB.
MAX_SAMPLES, MAX_REFERENCE_SAMPLES = 48, 24

# Iso-values: one bit each in a mask of 8.
MAX_ISOS = 8

# Smoothing of a B-spline: over dozens of nodes; rounding errors grow with it and reach 1e-8 here.
MAX_SMOOTHING = 1e6
