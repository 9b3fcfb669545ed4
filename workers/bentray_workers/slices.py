"""Slice-decomposed reconstruction: each slice is a chain of tasks, one per batch of emitters."""
