"""Names of tenants fit for a folder; claimed names have tenants of their own, and keep those of before."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from sqlalchemy import insert

from bentray_kernels.errors import InvalidInput
from bentray_service.rows.database import open_database
from bentray_service.rows.ids import LOCAL, TENANT_PATTERN, Tenant, checked_tenant
from bentray_service.rows.keys import ApiKey, ClaimedTenants, Keys, former_tenant
from bentray_service.rows.tables import ClaimedTenantRow

HERE, THERE = "https://id.example", "https://id.example.org"
# Names that look like another, that a key may have as tenant, and that are no names of folders.
ALIKE = ["clinic", "Clinic", "CLINIC", "clinic.", "\u0441linic", "clin\u0131c", "\uff43linic", "clinic\u0301"]
ALIKE += ["local", "project-0123456789abcdef0123", "user-" + "0" * 40, "../clinic", "x" * 200, "[]", '","']


@given(st.text(min_size=1, max_size=100), st.text(min_size=1, max_size=100))
def test_every_user_is_a_tenant_and_no_two_the_same(one, other):
    for user in (one, other):
        tenant = former_tenant(user)
        assert TENANT_PATTERN.fullmatch(tenant)
        assert checked_tenant(tenant) == tenant != LOCAL
    assert (former_tenant(one) == former_tenant(other)) == (one == other)


def test_tenant_names_are_unique():
    digest = former_tenant("Alice")
    assert digest.startswith("user-")
    assert former_tenant(digest) != digest
    assert former_tenant("local") != LOCAL
    assert former_tenant("alice@example.org") == "alice@example.org"


def key_of(database, tenant):
    Keys(database).add(ApiKey.new(), Tenant(tenant), "scanner", ("read",))


def of_before(database, *tenants):
    with database.write() as connection:
        rows = [{"tenant": one, "issuer": "", "claim": "", "value": one} for one in tenants]
        connection.execute(insert(ClaimedTenantRow), rows)


def test_no_two_names_share_a_tenant_and_none_has_that_of_a_key(database):
    key_of(database, "clinic")
    claims = [(issuer, claim) for issuer in (HERE, THERE, "proxy") for claim in ("sub", "groups")]
    found = {}
    for store in (ClaimedTenants(database), ClaimedTenants(database)):
        for name in [(*one, value) for one in claims for value in ALIKE]:
            tenant = store.tenant(*name, name[-1])
            assert found.setdefault(name, tenant) == tenant == checked_tenant(tenant)
    assert len(set(found.values())) == len(found)
    assert not {"clinic", LOCAL, *ALIKE} & set(found.values())


@pytest.mark.parametrize("kind", ["of a user", "of any user", "of a project"])
def test_no_key_gets_the_tenant_of_a_user_or_project(database, kind):
    given = {"of any user": "user-" + "0" * 40, "of a project": "project-0123456789abcdef0123"}
    tenant = given.get(kind) or ClaimedTenants(database).tenant(HERE, "sub", "alice", "alice")
    with pytest.raises(InvalidInput, match=r"^tenant: .*BENTRAY_OIDC_TENANTS"):
        key_of(database, tenant)


def test_a_tenant_of_before_goes_to_the_first_who_had_it(database):
    of_before(database, "alice", "bob", "lab")
    claimed = ClaimedTenants(database)
    assert claimed.tenant(HERE, "sub", "0815", "alice") == "alice"
    assert claimed.tenant(THERE, "sub", "0815", "alice") != "alice"
    assert ClaimedTenants(database).tenant(HERE, "sub", "0815", "alice") == "alice"
    with pytest.raises(InvalidInput, match="tenant: found alice"):
        key_of(database, "alice")
    # What the operator names is no longer that of a claimed name.
    key_of(database, "bob")
    claimed.keep_from_claims([Tenant("lab")])
    for name in ("bob", "lab"):
        assert claimed.tenant(HERE, "sub", name, name) != name


def test_of_two_services_at_once_one_is_first(address, monkeypatch):
    one, other = open_database(address), open_database(address)
    first, second = ClaimedTenants(one), ClaimedTenants(other)
    found = second._find
    monkeypatch.setattr(
        second, "_find", lambda name: found(name) if first._known else first.tenant(*name, "") and None
    )
    assert second.tenant(HERE, "sub", "alice", "alice") == first.tenant(HERE, "sub", "alice", "alice")
    one.close()
    other.close()
