"""Alembic's environment: the connection of a service, or for `alembic revision` that of its settings."""

from alembic import context
from sqlalchemy import Connection

from bentray_service.rows.database import SQLITE_PRAGMAS, engine_of
from bentray_service.rows.tables import Base
from bentray_service.settings import ServiceSettings


def _run(connection: Connection) -> None:
    context.configure(connection=connection, target_metadata=Base.metadata)
    with context.begin_transaction():
        context.run_migrations()


given = context.config.attributes.get("connection")
if given is None:
    with engine_of(ServiceSettings.load().database, SQLITE_PRAGMAS, patient=False).begin() as connection:
        _run(connection)
else:
    _run(given)
