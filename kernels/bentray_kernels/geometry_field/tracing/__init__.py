"""Ray tracing of scenes with geometry fields."""
