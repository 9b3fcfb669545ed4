"""Names of tenants: fit for a folder, and never two users one."""

from hypothesis import given
from hypothesis import strategies as st

from bentray_service.rows.tenants import LOCAL, PATTERN, checked_tenant, tenant_of_user


@given(st.text(min_size=1, max_size=100), st.text(min_size=1, max_size=100))
def test_every_user_is_a_tenant_and_no_two_the_same(one, other):
    for user in (one, other):
        tenant = tenant_of_user(user)
        assert PATTERN.fullmatch(tenant)
        assert checked_tenant(tenant) == tenant != LOCAL
    assert (tenant_of_user(one) == tenant_of_user(other)) == (one == other)


def test_tenant_names_are_unique():
    digest = tenant_of_user("Alice")
    assert digest.startswith("user-")
    assert tenant_of_user(digest) != digest
    assert tenant_of_user("local") != LOCAL
    assert tenant_of_user("alice@example.org") == "alice@example.org"
