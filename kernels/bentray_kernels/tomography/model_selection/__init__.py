"""Automatic choice of rays and method by held-out validation."""
