"""Scans in foreign formats, detected by content: MATLAB, NumPy, k-Wave, zea, openUSCT, KIT 3D USCT."""

from .conversion import convert_dataset, is_upload_format
from .scan_metadata import ScanMetadata

__all__ = ["ScanMetadata", "convert_dataset", "is_upload_format"]
