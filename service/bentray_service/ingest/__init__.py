"""From the bytes of a stranger to a canonical file of a scan, a volume or a mesh."""
