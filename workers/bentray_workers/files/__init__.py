"""File formats: datasets, volumes, meshes, reconstructions and geometry fields."""
