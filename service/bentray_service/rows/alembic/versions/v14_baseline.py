"""The baseline, and how databases of versions 12 and 13 come to it.

A new database is created from ``rows.tables`` and marked with the newest revision: nothing is created here.
"""

import secrets

import sqlalchemy as sa
from alembic import op

revision = "14"
down_revision = None

HOLDING = (
    *("datasets", "jobs", "projects", "volumes", "uploaded_volumes", "meshes"),
    *("geometry_fields", "uploads", "storage"),
)


def upgrade() -> None:
    """Take over a database of before Alembic."""
    connection = op.get_bind()
    about = connection.execute(sa.text("SELECT * FROM about")).mappings().one()
    if about["version"] == 12:
        _give_tenants_to_claimed_names()
    mark = connection.scalar(sa.text("SELECT database FROM bucket_mark")) or secrets.token_hex(16)
    op.drop_table("bucket_mark")
    op.drop_table("about")
    table = op.create_table(
        "about",
        sa.Column("database", sa.String(32), primary_key=True),
        sa.Column("probed", sa.Float, nullable=False),
        sa.Column("observed_s", sa.Float, nullable=False, server_default="0"),
        sa.Column("begun", sa.Integer, nullable=False, server_default="0"),
    )
    kept = {name: about[name] for name in ("probed", "observed_s", "begun")}
    op.bulk_insert(table, [{"database": mark, **kept}])


def _give_tenants_to_claimed_names() -> None:
    """Version 13: tenants of claimed names; names of projects are not unique."""
    op.create_table(
        "claimed_tenants",
        sa.Column("number", sa.Integer, primary_key=True),
        sa.Column("tenant", sa.String(64), nullable=False, unique=True),
        sa.Column("issuer", sa.String(500), nullable=False),
        sa.Column("claim", sa.String(200), nullable=False),
        sa.Column("value", sa.String(255), nullable=False),
        sa.UniqueConstraint("issuer", "claim", "value"),
    )
    tenants = " UNION ".join(f"SELECT tenant FROM {table}" for table in HOLDING)  # noqa: S608
    # A key has no claimed name, and the items of a project have its id.
    named = "SELECT tenant FROM keys UNION SELECT id FROM projects UNION SELECT 'local'"
    op.execute(
        "INSERT INTO claimed_tenants (tenant, issuer, claim, value) "  # noqa: S608
        f"SELECT tenant, '', '', tenant FROM ({tenants}) AS held WHERE tenant NOT IN ({named})"
    )
    # Users sign in again, and get their tenants.
    op.execute("DELETE FROM sessions")
    # SQLite has no name for the constraint.
    convention = {"uq": "%(table_name)s_%(column_0_N_name)s_key"}
    with op.batch_alter_table("projects", naming_convention=convention) as projects:
        projects.drop_constraint("projects_tenant_name_key", type_="unique")
        projects.create_index("projects_by_tenant", ["tenant"])
