"""Pictures as PNG: one slice of a reconstruction or a volume, a report, a comparison with the truth."""
