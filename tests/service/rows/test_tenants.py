"""Names of tenants: fit for a folder, and never two users one."""

from hypothesis import given
from hypothesis import strategies as st

from bentray_service.rows.tenants import LOCAL, PATTERN, checked_tenant, former_tenant


@given(st.text(min_size=1, max_size=100), st.text(min_size=1, max_size=100))
def test_every_user_is_a_tenant_and_no_two_the_same(one, other):
    for user in (one, other):
        tenant = former_tenant(user)
        assert PATTERN.fullmatch(tenant)
        assert checked_tenant(tenant) == tenant != LOCAL
    assert (former_tenant(one) == former_tenant(other)) == (one == other)


def test_tenant_names_are_unique():
    digest = former_tenant("Alice")
    assert digest.startswith("user-")
    assert former_tenant(digest) != digest
    assert former_tenant("local") != LOCAL
    assert former_tenant("alice@example.org") == "alice@example.org"
