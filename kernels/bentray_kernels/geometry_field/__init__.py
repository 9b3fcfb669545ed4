"""Geometry fields: tables that tell where a ray meets a mesh, and pictures of what mirrors and refracts."""
