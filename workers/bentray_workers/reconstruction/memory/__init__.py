"""Memory of the tasks of a reconstruction, computed before they run."""
