"""Simulated scans on a cluster: planned, run in tasks, written as datasets."""
