"""The settings of the service: environment variables with the prefix BENTRAY_, each with its meaning."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal, Self

from pydantic import AliasChoices, Field, ValidationError
from pydantic_settings import BaseSettings, SettingsConfigDict
from sqlalchemy.engine import make_url
from sqlalchemy.exc import ArgumentError

from bentray_kernels.errors import InvalidInput

GIB = 1024**3


class ServiceSettings(BaseSettings):
    """Everything that may differ between two installations.

    A field ``port`` is read from ``BENTRAY_PORT``; the one exception is ``DASK_SCHEDULER_ADDRESS``,
    which keeps the name that Dask users know.
    """

    model_config = SettingsConfigDict(env_prefix="BENTRAY_", frozen=True)

    data_dir: Path = Field(
        Path("bentray-data"), description="Folder of the datasets, volumes and the database."
    )
    host: str = Field("127.0.0.1", description="Address to listen on; 0.0.0.0 for every interface.")
    port: int = Field(8000, ge=0, le=65535, description="TCP port to listen on; 0 picks a free one.")
    max_upload_bytes: int = Field(2 * GIB, gt=0, description="Largest upload accepted, in bytes.")
    dask_scheduler_address: str | None = Field(
        None,
        validation_alias=AliasChoices("dask_scheduler_address", "DASK_SCHEDULER_ADDRESS"),
        description="Scheduler of an existing Dask cluster; without it the service starts its own workers.",
    )
    cluster: Literal["embedded", "slurm", "kubernetes"] = Field(
        "embedded", description="What starts the workers where no scheduler is given."
    )
    cluster_template: Path | None = Field(
        None, description="YAML file that tells slurm or kubernetes about this site."
    )
    tls_dir: Path | None = Field(
        None, description="Folder of the certificates for the scheduler and the workers; no TLS without it."
    )
    workers: int | None = Field(None, gt=0, description="Worker processes to start; one a core without it.")
    database_url: str | None = Field(
        None, description="SQLAlchemy address of the database; an SQLite file in data_dir without it."
    )
    database_password_file: Path | None = Field(
        None, description="File whose first line is the password of database_url, which then holds none."
    )
    storage_url: str | None = Field(
        None,
        pattern=r"^s3://[a-z0-9][a-z0-9.-]{1,61}[a-z0-9](/[A-Za-z0-9!_.*'()-]+)*/?$",
        description="s3://bucket/prefix to keep the files in; without it they stay in data_dir.",
    )
    cache_bytes: int = Field(
        50 * GIB, ge=0, description="Bytes that data_dir may hold of what is kept in storage_url."
    )
    jobs_at_once: int = Field(2, ge=1, le=64, description="Jobs that run at the same time; the others wait.")
    tenants_at_once: int = Field(
        16,
        ge=1,
        le=256,
        description="Tenants of whom one job runs in any case, beyond jobs_at_once; the workers are shared.",
    )
    max_queued_jobs: int = Field(
        1000, ge=1, description="Jobs that may wait, of each tenant; a further one is refused with 429."
    )
    ingest_memory_bytes: int = Field(
        4 * GIB,
        ge=GIB // 2,
        description="Address space of the process that opens an uploaded file, in bytes.",
    )
    ingest_seconds: float = Field(120.0, gt=0, description="Time that process may take, in seconds.")
    upload_patience_s: float = Field(
        60.0, gt=0, description="Time in which 64 KiB of a body must come, in seconds; else it is broken off."
    )
    upload_keep_s: float = Field(
        86400.0,
        gt=0,
        description="How long an unfinished upload is kept after something came, in seconds.",
    )
    keep_days: float | None = Field(
        None,
        gt=0,
        description="Age at which datasets, volumes, meshes and jobs without any are deleted; "
        "never without it.",
    )
    min_free_bytes: int = Field(
        GIB // 2,
        ge=0,
        description="Free disk space below which the service is not ready and begins no job, in bytes.",
    )

    first_key_file: Path | None = Field(
        None,
        description="File with the first key, of tenant local with every scope; read while there is none.",
    )
    trusted_proxies: str | None = Field(
        None, description="Addresses or networks, parted by commas, of proxies that are believed who calls."
    )
    proxy_user_header: str = Field(
        "X-Forwarded-User",
        pattern=r"^[A-Za-z0-9-]+$",
        description="Header in which such a proxy names the user, who is a tenant.",
    )
    connections_per_address: int | None = Field(
        None,
        ge=1,
        description="Connections that one client address may have open, trusted proxies apart; without it a "
        "quarter of all that there are descriptors for, which are 4096 at most.",
    )
    requests_per_minute: int = Field(
        1200, ge=0, description="Requests of a tenant, where keys or a proxy are used; 0: any number."
    )
    renders_per_minute: int = Field(240, ge=0, description="The same of pictures that are drawn.")
    max_tenant_bytes: int = Field(100 * GIB, gt=0, description="Bytes that a tenant may store.")
    log_format: Literal["text", "json"] = Field(
        "text", description="Form of the log: warnings as words, or every request as a line of JSON."
    )

    @classmethod
    def load(cls, **given: Any) -> Self:
        """Read the environment; what is ``given`` wins.

        Raises:
            InvalidInput: naming the first setting that is wrong, as its environment variable.
        """
        try:
            return cls(**given)
        except ValidationError as error:
            first = error.errors()[0]
            name = str(first["loc"][0]).upper()
            if not name.startswith("DASK_"):
                name = f"BENTRAY_{name}"
            accepted = first["msg"].removeprefix("Input should be ")
            raise InvalidInput(name, repr(first["input"]), accepted) from None

    @property
    def database(self) -> str:
        """The address of the database that is really used, with its password.

        Raises:
            InvalidInput: when the password cannot be read, or there is nothing that it belongs to.
        """
        if self.database_password_file is None:
            return self.database_url or f"sqlite:///{self.data_dir.resolve() / 'bentray.sqlite'}"
        if self.database_url is None:
            raise InvalidInput(
                "BENTRAY_DATABASE_PASSWORD_FILE", self.database_password_file, "none without a database_url"
            )
        try:
            password = self.database_password_file.read_text().partition("\n")[0]
            address = make_url(self.database_url).set(password=password)
        except OSError as error:
            found = f"{self.database_password_file} ({error.strerror})"
            raise InvalidInput("BENTRAY_DATABASE_PASSWORD_FILE", found, "a file that can be read") from error
        except ArgumentError as error:
            raise InvalidInput("BENTRAY_DATABASE_URL", self.database_url, "a SQLAlchemy address") from error
        return address.render_as_string(hide_password=False)
