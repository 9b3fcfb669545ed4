"""The rows of volumes."""

from __future__ import annotations

from typing import Any

from sqlalchemy import select

from ..refusals import UnknownId
from .database import Database
from .ids import checked
from .schema import jobs, volumes

Row = dict[str, Any]


class Volumes:
    """What is known of each volume; a row is written with the success of its job and never changed."""

    def __init__(self, database: Database) -> None:
        self._database = database

    def get(self, volume_id: str) -> Row:
        """One volume, with the dataset it was made of.

        Raises:
            UnknownId: when there is none.
        """
        query = (
            select(volumes, jobs.c.dataset_id)
            .join(jobs, jobs.c.id == volumes.c.job_id)
            .where(volumes.c.id == checked("volume", volume_id))
        )
        with self._database.read() as connection:
            row = connection.execute(query).mappings().one_or_none()
        if row is None:
            raise UnknownId("volume", volume_id)
        return dict(row)
