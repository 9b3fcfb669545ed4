"""Jobs: what kinds there are, how one is run, and how its failure is told."""
