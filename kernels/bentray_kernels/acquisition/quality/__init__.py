"""What is wrong with a scan: checks of traces and of picks, each finding named, and what is done about it."""

from .correction import corrected
from .examination import Examined, examine, examine_slices
from .finding import Finding, Report

__all__ = ["Examined", "Finding", "Report", "corrected", "examine", "examine_slices"]
