"""The page for data-protection officers states what each table of the database holds."""

from pathlib import Path

from bentray_service.rows.tables import Base

PAGE = Path(__file__).resolve().parents[2] / "docs" / "reference" / "data-protection.md"

# The row of the page for each table; None: nothing about persons.
STATED = {
    "about": None,
    "alembic_version": None,
    "checksums": None,
    "events": "jobs",
    "geometry_fields": "scans, volumes, meshes, fields",
    "jobs": "jobs",
    "batches": "names and notes",
    "datasets": "scans, volumes, meshes, fields",
    "meshes": "scans, volumes, meshes, fields",
    "uploaded_volumes": "scans, volumes, meshes, fields",
    "volumes": "scans, volumes, meshes, fields",
    "uploads": "unfinished uploads",
    "keys": "API keys",
    "claimed_tenants": "users",
    "sessions": "sessions of browsers",
    "pending_sign_ins": "sign-ins in progress",
    "projects": "projects and members",
    "project_members": "projects and members",
    "deliveries": "webhooks",
    "webhook_secrets": "webhooks",
    "storage": None,
    "too_old": None,
}


def test_every_table_is_stated() -> None:
    rows = [line.split("|")[1].strip() for line in PAGE.read_text().splitlines() if line.startswith("| ")]
    assert set(STATED) == {table.name for table in Base.metadata.sorted_tables}
    for table, stated in STATED.items():
        assert stated is None or any(row.startswith(stated) for row in rows), table
