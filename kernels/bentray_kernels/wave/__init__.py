"""Acoustic waves: a finite-difference simulator in 2-D and 3-D, and its adjoint (3-D on devices)."""
