"""Ingestion of untrusted uploads into canonical files of scans, volumes and meshes."""
