"""Writers of volumes in the formats of other programs."""
