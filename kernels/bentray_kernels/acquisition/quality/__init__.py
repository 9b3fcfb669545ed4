"""Quality control of scans: checks of traces and picks, findings, and their correction."""

from .correction import corrected
from .examination import Examined, examine, examine_slices
from .finding import Finding, Report

__all__ = ["Examined", "Finding", "Report", "corrected", "examine", "examine_slices"]
