"""The settings of the service: environment variables with the prefix BENTRAY_, each with its meaning."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Self

from pydantic import AliasChoices, Field, ValidationError
from pydantic_settings import BaseSettings, SettingsConfigDict

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
    max_upload_bytes: int = Field(2 * GIB, gt=0, description="Largest dataset file accepted, in bytes.")
    dask_scheduler_address: str | None = Field(
        None,
        validation_alias=AliasChoices("dask_scheduler_address", "DASK_SCHEDULER_ADDRESS"),
        description="Scheduler of an existing Dask cluster; without it the service starts its own workers.",
    )
    workers: int | None = Field(None, gt=0, description="Worker processes to start; one a core without it.")
    database_url: str | None = Field(
        None, description="SQLAlchemy address of the database; an SQLite file in data_dir without it."
    )
    jobs_at_once: int = Field(2, ge=1, le=64, description="Jobs that run at the same time; the others wait.")
    ingest_memory_bytes: int = Field(
        4 * GIB,
        ge=GIB // 2,
        description="Address space of the process that opens an uploaded file, in bytes.",
    )
    ingest_seconds: float = Field(120.0, gt=0, description="Time that process may take, in seconds.")
    min_free_bytes: int = Field(
        GIB // 2,
        ge=0,
        description="Free disk space below which the service reports itself not ready, in bytes.",
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
        """The address of the database that is really used."""
        return self.database_url or f"sqlite:///{self.data_dir.resolve() / 'bentray.sqlite'}"
