"""Quality control of scans: checks of traces and picks, findings, and their correction."""

from .examination import Examined, examine
from .finding import Finding, Report

__all__ = ["Examined", "Finding", "Report", "examine"]
