"""Bentray in a Python session: scans, reconstructions, results; exported by the package ``bentray``."""
