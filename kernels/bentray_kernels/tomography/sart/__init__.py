"""Eikonal-SART: travel times of one emitter after another, projected back along bent rays."""
