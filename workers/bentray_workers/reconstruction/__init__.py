"""Reconstruction on a cluster: planned, run in tasks, checkpointed."""
