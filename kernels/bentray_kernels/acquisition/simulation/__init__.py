"""Simulated scans of phantoms: travel times and attenuation, in a plane and of a volume."""
