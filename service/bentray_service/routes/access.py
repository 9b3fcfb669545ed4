"""/v1/access: who asks, and what it may do and store."""

from __future__ import annotations

from typing import Literal

from fastapi import APIRouter
from pydantic import BaseModel, Field

from ..web.errors import problems
from ..wiring import CurrentCaller, Service

router = APIRouter(prefix="/v1/access", tags=["access"])


class AccessRecord(BaseModel):
    """The caller as the service sees it."""

    tenant: str = Field(description="Whose data it works on.")
    how: Literal["open", "key", "proxy"] = Field(
        description="How it is known; open: nobody on this machine is asked for a key."
    )
    who: str = Field(description="The id of the key, or the user of the proxy.")
    scopes: list[str]
    bytes_stored: int = Field(description="By the tenant, over all.")
    bytes_reserved: int = Field(description="For its uploads and jobs that are not at their end.")
    bytes_most: int = Field(description="That the tenant may store.")
    requests_per_minute: int = Field(description="That the tenant may send; 0: any number.")
    renders_per_minute: int = Field(description="Pictures among them that may be drawn; 0: any number.")


@router.get("", responses=problems(503))
def show_access(service: Service, caller: CurrentCaller) -> AccessRecord:
    """Who the caller is, and what it may do and store."""
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
