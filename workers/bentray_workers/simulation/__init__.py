"""Simulated scans: requests, plans, task graphs and datasets."""
