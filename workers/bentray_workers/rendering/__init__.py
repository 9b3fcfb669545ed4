"""Refractive volume rendering, turntables and geometry fields as tasks."""
