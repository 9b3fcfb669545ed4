"""/v1/access: identity, permissions and storage usage of the caller."""

from __future__ import annotations

from typing import Literal

from fastapi import APIRouter
from pydantic import BaseModel, Field

from ..web.errors import problems
from ..wiring import CurrentCaller, Service

router = APIRouter(prefix="/v1/access", tags=["access"])


class AccessRecord(BaseModel):
    """The caller: identity, scopes, storage and rate limits."""

    tenant: str = Field(description="Owner of the data.")
    how: Literal["open", "key", "proxy"] = Field(
        description="Authentication method; open: not required on this machine."
    )
    who: str = Field(description="Id of the key, or user name from the proxy.")
    scopes: list[str]
    bytes_stored: int = Field(description="Bytes stored by the tenant.")
    bytes_reserved: int = Field(description="Bytes reserved for uploads and unfinished jobs.")
    bytes_most: int = Field(description="Storage quota of the tenant, bytes.")
    requests_per_minute: int = Field(description="Rate limit of the tenant; 0: unlimited.")
    renders_per_minute: int = Field(
        description="Rate limit for rendered images; those of few rays count less; 0: unlimited."
    )


@router.get("", responses=problems(503))
def show_access(service: Service, caller: CurrentCaller) -> AccessRecord:
    """Show the identity, permissions and storage usage of the caller."""
    settings, limited = service.settings, caller.how != "open"
    used = service.quota.of(caller.tenant)
    return AccessRecord(
        tenant=caller.tenant,
        how=caller.how,
        who=caller.who,
        scopes=sorted(caller.scopes),
        bytes_stored=used.stored,
        bytes_reserved=used.reserved,
        bytes_most=settings.max_tenant_bytes,
        requests_per_minute=settings.requests_per_minute if limited else 0,
        renders_per_minute=settings.renders_per_minute if limited else 0,
    )
