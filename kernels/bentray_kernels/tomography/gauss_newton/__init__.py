"""Gauss–Newton with bent rays, total variation and a robust loss."""
