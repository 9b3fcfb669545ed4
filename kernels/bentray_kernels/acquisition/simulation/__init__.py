"""Simulated scans of phantoms: travel times and attenuation, in 2-D and 3-D."""
