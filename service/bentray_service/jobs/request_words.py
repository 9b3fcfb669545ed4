"""Descriptions that the requests of several kinds of jobs share; light, because clients import them too."""

from __future__ import annotations

DEFAULTS = "Omitted settings take their defaults."
