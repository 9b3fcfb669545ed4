"""Reflection image: delay and sum of echoes along bent rays."""
