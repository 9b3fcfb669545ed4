"""Geometry fields: tables of where rays meet a mesh, and renderings of mirroring and refracting meshes."""
