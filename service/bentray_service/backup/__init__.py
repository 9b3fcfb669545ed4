"""Backups of a whole service, and their restoration."""
