"""Projects: roles of members, an owner at all times, one quota with their tenant, and an end when empty."""

import pytest
from sqlalchemy import insert

from bentray_kernels.errors import InvalidInput
from bentray_service.errors import InUse, QuotaExceeded, UnknownId
from bentray_service.rows import usage
from bentray_service.rows.accounts import family_of
from bentray_service.rows.ids import Tenant
from bentray_service.rows.projects import Projects, membership
from bentray_service.rows.tables import StorageRow

LAB, OTHER = Tenant("lab"), Tenant("other")
ALICE, BOB = "user:alice", "user:bob"


@pytest.fixture
def projects(database):
    return Projects(database)


def test_only_members_see_a_project(projects):
    one, two = projects.add(LAB, "One", ALICE), projects.add(LAB, "Two", BOB)
    projects.put_member(one, BOB, "reader")
    assert [(row.name, row.role) for row in projects.all(LAB, BOB)] == [
        ("One", "reader"),
        ("Two", "owner"),
    ]
    assert [row.id for row in projects.all(LAB, ALICE)] == [one.id]
    assert (
        projects.all(OTHER, ALICE) == projects.all(LAB, "user:ALICE") == projects.all(LAB, "key:alice") == []
    )
    for tenant, name, member in (
        (LAB, two.id, ALICE),
        (OTHER, one.id, ALICE),
        (LAB, "project-x", ALICE),
    ):
        with pytest.raises(UnknownId):
            projects.get(tenant, name, member)
    # Without authentication everything is allowed.
    assert projects.get(LAB, two.id, None).role == "owner"
    assert [row.member for row in projects.members(one)] == [ALICE, BOB]


def test_someone_owns_it_at_all_times(projects):
    project = projects.add(LAB, "One", ALICE)
    for change in (
        lambda: projects.remove_member(project, ALICE),
        lambda: projects.put_member(project, ALICE, "contributor"),
    ):
        with pytest.raises(InvalidInput, match="no owner left"):
            change()
    projects.put_member(project, BOB, "owner")
    projects.remove_member(project, ALICE)
    assert projects.members(project)[0].member == BOB
    with pytest.raises(InvalidInput, match="a member of the project"):
        projects.remove_member(project, ALICE)


@pytest.mark.parametrize("member", ["alice", "key:xyz", "user:", "user:a\nb", "user:" + "x" * 201])
def test_members_are_keys_or_users(projects, member):
    with pytest.raises(InvalidInput, match="member"):
        projects.put_member(projects.add(LAB, "One", ALICE), member, "reader")


def test_names_of_projects_of_others_are_free(projects):
    """A refusal would tell that there is one."""
    projects.add(LAB, "One", ALICE)
    two = projects.add(LAB, "Two", BOB)
    assert projects.add(LAB, "One", BOB).name == "One"
    projects.rename(two, "One")
    assert [row.name for row in projects.all(LAB, BOB)] == ["One", "One"]


def test_memberships_end(projects):
    project = projects.add(LAB, "One", ALICE)
    projects.put_member(project, BOB, "reader")
    names = [membership(project.id, one) for one in (ALICE, BOB)]
    assert projects.ended([*names, "0123456789ab"]) == []
    projects.remove_member(project, BOB)
    assert projects.ended([*names, "0123456789ab"]) == names[1:]


def test_a_project_shares_the_quota_of_its_tenant(projects, database):
    one, two = (Tenant(projects.add(LAB, name, ALICE).id) for name in ("One", "Two"))
    with database.write() as connection:
        usage.reserve(connection, one, "ds-1", 60, 100)
        usage.store(connection, LAB, "ds-2", 30)
        usage.store(connection, OTHER, "ds-3", 1000)
        assert family_of(connection, one) == family_of(connection, LAB) == [LAB, one, two]
        assert family_of(connection, OTHER) == [OTHER]
        for tenant in (LAB, one, two):
            assert usage.usage_of(connection, tenant) == usage.Usage(30, 60)
        usage.reserve(connection, two, "ds-4", 10, 100)
        # The same name in another project is another item.
        with pytest.raises(QuotaExceeded):
            usage.reserve(connection, two, "ds-1", 10, 100)
        usage.reserve(connection, one, "ds-1", 55, 100)


def test_only_an_empty_project_is_deleted(projects, database):
    project = projects.add(LAB, "One", ALICE)
    row = {"tenant": project.id, "name": "ds-1", "bytes": 1, "reserved": True}
    with database.write() as connection:
        connection.execute(insert(StorageRow).values(**row))
    with pytest.raises(InUse, match="with storage"):
        projects.delete(project)
    with database.write() as connection:
        usage.release(connection, Tenant(project.id), "ds-1")
    projects.delete(project)
    assert projects.all(LAB, None) == []
