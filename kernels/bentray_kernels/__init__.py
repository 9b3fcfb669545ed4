"""Numerical kernels of Bentray: arrays in, arrays out; no cluster, no server, no files."""
