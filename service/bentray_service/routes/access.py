"""/v1/access: identity, permissions, storage and keys of the caller."""

from datetime import datetime
from typing import Literal

from fastapi import APIRouter
from pydantic import BaseModel, ConfigDict, Field

from ..rows.keys import Keys
from ..rows.usage import StoredKind, usage_by_kind
from ..web.errors import problems
from ..wiring import Context

router = APIRouter(prefix="/v1/access", tags=["access"])


class AccessRecord(BaseModel):
    """The caller: identity, scopes, storage and rate limits."""

    tenant: str = Field(description="Owner of the data.")
    how: Literal["open", "key", "proxy", "session"] = Field(
        description="Authentication method; open: not required on this machine; session: signed in at the "
        "OpenID provider."
    )
    who: str = Field(description="Id of the key, or user name from the proxy or provider.")
    project: str | None = Field(description="Id of the project in which the request acts.")
    role: str | None = Field(description="Role in this project.")
    scopes: list[str] = Field(description="Permissions, in a project those of the role.")
    bytes_stored: int = Field(description="Bytes stored by the tenant, its projects included.")
    bytes_reserved: int = Field(description="Bytes reserved for uploads and unfinished jobs.")
    bytes_most: int = Field(description="Storage quota of the tenant, bytes.")
    requests_per_minute: int = Field(description="Rate limit of the tenant; 0: unlimited.")
    renders_per_minute: int = Field(
        description="Rate limit for rendered images; those of few rays count less; 0: unlimited."
    )


class StorageRecord(BaseModel):
    """Stored items of one kind."""

    kind: StoredKind = Field(
        description="results: volumes of reconstructions; volumes: uploaded ones; jobs: space for unfinished "
        "jobs, and turntables; uploads: unfinished ones."
    )
    items: int = Field(description="Number of stored items.")
    stored: int = Field(description="Bytes stored.")
    reserved: int = Field(description="Bytes reserved.")


class StorageList(BaseModel):
    """Storage of the tenant by kind, without kinds that it has nothing of."""

    storage: list[StorageRecord]
    bytes_most: int = Field(description="Storage quota of the tenant, bytes.")


class OwnKey(BaseModel):
    """One API key of the tenant; its secret is not stored."""

    model_config = ConfigDict(from_attributes=True)

    id: str
    name: str
    scopes: list[str]
    created: datetime
    expires: datetime | None = Field(description="Null: it does not expire.")
    revoked: datetime | None
    used: datetime | None = Field(description="Last use, to the minute.")


class OwnKeyList(BaseModel):
    """The API keys of the tenant, oldest first."""

    keys: list[OwnKey]


@router.get("", responses=problems(503))
def show_access(context: Context) -> AccessRecord:
    """Show the identity, permissions and storage usage of the caller."""
    caller, settings = context.caller, context.access.settings
    limited, used = caller.how != "open", context.stores.quota.of(caller.tenant)
    return AccessRecord(
        tenant=caller.home,
        project=caller.project or None,
        role=caller.role or None,
        how=caller.how,
        who=caller.who,
        scopes=sorted(caller.scopes),
        bytes_stored=used.stored,
        bytes_reserved=used.reserved,
        bytes_most=settings.max_tenant_bytes,
        requests_per_minute=settings.requests_per_minute if limited else 0,
        renders_per_minute=settings.renders_per_minute if limited else 0,
    )


@router.get("/storage", responses=problems(503))
def show_storage(context: Context) -> StorageList:
    """Show the storage of the tenant by kind."""
    found = usage_by_kind(context.stores.database, context.tenant)
    storage = [
        StorageRecord(kind=kind, items=items, stored=stored, reserved=reserved)
        for kind, (items, stored, reserved) in found.items()
    ]
    return StorageList(storage=storage, bytes_most=context.access.settings.max_tenant_bytes)


@router.get("/keys", responses=problems(503))
def list_keys(context: Context) -> OwnKeyList:
    """List the API keys of the tenant; `bentray keys` creates and revokes them."""
    rows = Keys(context.stores.database).all(context.caller.home)
    return OwnKeyList(keys=[OwnKey.model_validate(row) for row in rows])
