"""The settings of the service: environment variables with the prefix BENTRAY_."""

from collections.abc import Iterator, Mapping
from difflib import get_close_matches
from pathlib import Path
from typing import Any, Literal, Self

from pydantic import AliasChoices, Field, Json, ValidationError
from pydantic_settings import BaseSettings, SettingsConfigDict
from sqlalchemy.engine import make_url
from sqlalchemy.exc import ArgumentError

from bentray_kernels.errors import InvalidInput

GIB = 1024**3
PREFIX = "BENTRAY_"

# Read by other parts of Bentray: kernels, worker, client, image.
OF_OTHER_PARTS = {
    f"{PREFIX}{name}"
    for name in (
        *("DEVICE", "OPENCL_DEVICE", "PYTHON"),
        *("WORKER_MEMORY", "KEY", "PROJECT", "COMPILED", "DOCUMENTATION"),
    )
}
# Read by docker-compose.yml, which passes its whole .env to the service.
OF_COMPOSE = {
    f"{PREFIX}{name}"
    for name in (
        *("PUBLISH", "PUBLISH_TLS", "GRAFANA_PUBLISH", "WORKER_CONTAINER_MEMORY"),
        *(f"{part}_CPUS" for part in ("EDGE", "SERVICE", "SCHEDULER", "WORKER", "DATABASE", "MONITORING")),
        *(f"{part}_MEMORY" for part in ("EDGE", "SERVICE", "SCHEDULER", "DATABASE", "MONITORING")),
        *(f"{name}_SECRET" for name in ("FIRST_KEY", "DATABASE_PASSWORD", "METRICS_KEY", "GRAFANA_PASSWORD")),
        *(f"EDGE_{name}_SECRET" for name in ("CERTIFICATE", "KEY")),
    )
}


class ServiceSettings(BaseSettings):
    """The settings of an installation.

    A field ``port`` is read from ``BENTRAY_PORT``; the only exception is ``DASK_SCHEDULER_ADDRESS``, the
    usual name in Dask.
    """

    model_config = SettingsConfigDict(env_prefix=PREFIX, frozen=True)

    data_dir: Path = Field(
        Path("bentray-data"), description="Folder of the datasets, volumes and the database."
    )
    host: str = Field(
        "127.0.0.1",
        description="Address to listen on; any but a loopback address requires behind_proxy, trusted_proxies "
        "or bare.",
    )
    behind_proxy: str | None = Field(
        None,
        description="Addresses or networks of proxies in front that only forward, such as nginx with "
        "deploy/nginx.conf, separated by commas.",
    )
    bare: bool = Field(
        False,
        description="Listen on any address without a proxy: without TLS, and without limits of connections "
        "and slow clients.",
    )
    port: int = Field(8000, ge=0, le=65535, description="TCP port to listen on; 0 picks a free one.")
    max_upload_bytes: int = Field(2 * GIB, gt=0, description="Largest upload accepted, in bytes.")
    dask_scheduler_address: str | None = Field(
        None,
        validation_alias=AliasChoices("dask_scheduler_address", "DASK_SCHEDULER_ADDRESS"),
        description="Scheduler of an existing Dask cluster; default: the service starts its own workers.",
    )
    cluster: Literal["embedded", "slurm", "kubernetes"] = Field(
        "embedded", description="How workers are started without a scheduler address."
    )
    cluster_template: Path | None = Field(
        None, description="YAML file with the site configuration for slurm or kubernetes."
    )
    tls_dir: Path | None = Field(
        None, description="Folder with certificates for scheduler and workers; default: no TLS."
    )
    workers: int | None = Field(None, gt=0, description="Worker processes to start; default: one per core.")
    database_url: str | None = Field(
        None, description="SQLAlchemy address of the database; default: an SQLite file in data_dir."
    )
    database_password_file: Path | None = Field(
        None, description="File with the password of database_url in its first line."
    )
    storage_url: str | None = Field(
        None,
        pattern=r"^(s3|gs|az)://[a-z0-9][a-z0-9.-]{1,61}[a-z0-9](/[A-Za-z0-9!_.*'()-]+)*/?$",
        description="s3://bucket/prefix (or gs://, az://) to store the files; default: data_dir.",
    )
    storage_public_endpoint: str | None = Field(
        None,
        pattern=r"^https?://[^/?#@\s]+$",
        description="Address of the S3 server for clients, without a path; addresses of direct uploads are "
        "signed for it; default: that of the service.",
    )
    cache_bytes: int = Field(
        50 * GIB, ge=0, description="Size of the cache of storage_url in data_dir, in bytes."
    )
    jobs_at_once: int = Field(
        2, ge=1, le=64, description="Maximum number of running jobs; others are queued."
    )
    tenants_at_once: int = Field(
        16,
        ge=1,
        le=256,
        description="Maximum number of running jobs including one of each tenant, beyond jobs_at_once; the "
        "last one is always that of another tenant.",
    )
    max_queued_jobs: int = Field(
        1000,
        ge=1,
        description="Maximum number of queued jobs per tenant; further ones are rejected with 429.",
    )
    ingest_memory_bytes: int = Field(
        4 * GIB,
        ge=GIB // 2,
        description="Address space of the ingest process for uploaded files, in bytes.",
    )
    ingest_seconds: float = Field(
        120.0, gt=0, description="CPU time limit of this process, in seconds; four times as long in all."
    )
    upload_keep_s: float = Field(
        86400.0,
        gt=0,
        description="Keeping time of an incomplete upload without further data, in seconds.",
    )
    keep_days: float | None = Field(
        None,
        gt=0,
        description="Maximum age of datasets, volumes, meshes and jobs without them; default: unlimited.",
    )
    audit_keep_days: float | None = Field(
        None, gt=0, description="Days for which the audit log is kept; default: unlimited."
    )
    min_free_bytes: int = Field(
        GIB // 2,
        ge=0,
        description="Minimum free disk space for readiness and for starting jobs, in bytes.",
    )

    first_key_file: Path | None = Field(
        None,
        description="File with the first key, for the tenant local with all scopes; read if there is no key.",
    )
    trusted_proxies: str | None = Field(
        None, description="Addresses or networks of trusted authenticating proxies, separated by commas."
    )
    proxy_user_header: str = Field(
        "X-Forwarded-User",
        pattern=r"^[A-Za-z0-9-]+$",
        description="Header with the user name from such a proxy; each user is a tenant.",
    )
    public_url: str | None = Field(
        None,
        pattern=r"^https?://[^/?#@\s]+$",
        description="Address of the service for browsers, without a path; needed with oidc_issuer.",
    )
    oidc_issuer: str | None = Field(
        None,
        max_length=500,
        pattern=r"^https?://[^?#@\s]+$",
        description="Issuer of an OpenID Connect provider, at which users of the page sign in.",
    )
    oidc_name: str | None = Field(
        None, max_length=60, description="Name of the provider on the page; default: its host name."
    )
    oidc_client_id: str | None = Field(None, description="Client id of this service at the provider.")
    oidc_client_secret_file: Path | None = Field(
        None, description="File with the client secret in its first line; default: a public client."
    )
    oidc_scope: str = Field(
        "openid profile email",
        pattern=r"^(.* )?openid( .*)?$",
        description="Scopes requested from the provider, with spaces.",
    )
    oidc_user_claim: str = Field(
        "sub",
        description="Claim with the name of the user, unique at the provider and never given to another.",
    )
    oidc_tenant_claim: str | None = Field(
        None,
        description="Claim with the tenant or the groups of the user, nested ones with dots; default: "
        "each user is a tenant.",
    )
    oidc_tenants: Json[dict[str, str]] | None = Field(
        None,
        description='Tenants by value of that claim, as {"/lab": "lab"}; the first that the user has counts.',
    )
    oidc_role_claim: str | None = Field(
        None, description="Claim with the roles of the user, nested ones with dots."
    )
    oidc_roles: Json[dict[str, str]] | None = Field(
        None,
        description='Scopes by value of that claim, as {"viewer": "read"}; default: read,write.',
    )
    session_hours: float = Field(
        12.0, gt=0, le=24 * 30, description="Time after which a user signs in again, in hours."
    )
    requests_per_minute: int = Field(
        1200, ge=0, description="Rate limit per tenant with keys or a proxy; 0: unlimited."
    )
    renders_per_minute: int = Field(
        240,
        ge=0,
        description="Rate limit for rendered images; those of few rays count less; 0: unlimited.",
    )
    max_tenant_bytes: int = Field(100 * GIB, gt=0, description="Storage quota per tenant, in bytes.")
    webhooks: bool = Field(True, description="Whether jobs may have webhooks, and messages to them are sent.")
    webhook_networks: str | None = Field(
        None,
        description="Networks that webhooks may reach beside public addresses, separated by commas; "
        "http without TLS is accepted there only.",
    )
    log_format: Literal["text", "json"] = Field(
        "text", description="Log format: warnings as text, or all requests as lines of JSON."
    )

    @classmethod
    def load(cls, **given: Any) -> Self:
        """Read the environment; ``given`` values take precedence.

        Raises:
            InvalidInput: naming the first invalid setting as an environment variable.
        """
        try:
            return cls(**given)
        except ValidationError as error:
            first = error.errors()[0]
            name = str(first["loc"][0]).upper()
            if not name.startswith("DASK_"):
                name = f"{PREFIX}{name}"
            accepted = first["msg"].removeprefix("Input should be ")
            raise InvalidInput(name, repr(first["input"]), accepted) from None

    @classmethod
    def unused_variables(cls, environment: Mapping[str, str], options: Mapping[str, str]) -> Iterator[str]:
        """A sentence for each variable that has no effect: of no setting, or overridden by an option.

        Args:
            environment: all variables; case does not count, as for ``load``.
            options: the options given, by the name of their setting: option and value, as ``--port 8000``.
        """
        settings = {f"{PREFIX}{name.upper()}": name for name in cls.model_fields}
        for variable in sorted(name for name in environment if name.upper().startswith(PREFIX)):
            name = variable.upper()
            if name in settings:
                option = options.get(settings[name])
                if option is not None and environment[variable] != option.partition(" ")[2]:
                    yield f"{variable} has no effect: {option} is given and overrides it."
            elif name not in OF_OTHER_PARTS | OF_COMPOSE:
                known = [one.removeprefix(PREFIX) for one in (*settings, *OF_OTHER_PARTS)]
                nearest = get_close_matches(name.removeprefix(PREFIX), known, 1)
                hint = f"; the nearest is {PREFIX}{nearest[0]}" if nearest else ""
                yield f"{variable} has no effect: no such setting{hint}."

    @property
    def database(self) -> str:
        """The address of the database, including the password.

        Raises:
            InvalidInput: when the password cannot be read, or is given without ``database_url``.
        """
        if self.database_password_file is None:
            return self.database_url or f"sqlite:///{self.data_dir.resolve() / 'bentray.sqlite'}"
        if self.database_url is None:
            raise InvalidInput(
                "BENTRAY_DATABASE_PASSWORD_FILE", self.database_password_file, "none without a database_url"
            )
        text = read_secret(self.database_password_file, "BENTRAY_DATABASE_PASSWORD_FILE")
        try:
            address = make_url(self.database_url).set(password=text.partition("\n")[0])
        except ArgumentError as error:
            raise InvalidInput("BENTRAY_DATABASE_URL", self.database_url, "a SQLAlchemy address") from error
        return address.render_as_string(hide_password=False)


def read_secret(path: Path, setting: str) -> str:
    """The text of a file with a secret.

    Raises:
        InvalidInput: naming the setting, for a file that cannot be read.
    """
    try:
        return path.read_text()
    except (OSError, UnicodeDecodeError) as error:
        found = f"{path} ({getattr(error, 'strerror', None) or 'not text'})"
        raise InvalidInput(setting, found, "a readable file") from error
