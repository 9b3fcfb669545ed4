"""Triangle meshes: topology, defects, bounding volume hierarchy, exact intersection, iso-surfaces."""
