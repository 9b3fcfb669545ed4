"""How much a tenant may store."""

from __future__ import annotations

from ..refusals import QuotaUsedUp
from ..storage.tenant_files import TenantFiles


def check_room(files: TenantFiles, most: int, wanted: int = 1) -> None:
    """Refuse what would not fit.

    What several requests bring at the same moment may together go beyond it, once.

    Args:
        files: of the tenant.
        most: bytes that it may store.
        wanted: bytes that are to come.

    Raises:
        QuotaUsedUp: when there is less room.
    """
    used = files.bytes_used()
    if used + wanted > most:
        raise QuotaUsedUp(
            "storage",
            f"{used} bytes stored, {wanted} more asked for",
            f"at most {most} bytes for a tenant (BENTRAY_MAX_TENANT_BYTES); delete something",
        )
