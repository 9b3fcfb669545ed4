"""Survivors of the mutation run that change no result, each with the reason."""

from __future__ import annotations

# By module, function and change, as ``key`` of the mutation run writes them.
EQUIVALENT: dict[str, str] = {}
