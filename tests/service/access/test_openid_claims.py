"""Claims of a user become tenant, name and scopes, or a refusal."""

import json

import pytest

from bentray_service.access.openid_claims import ClaimMapping, values_of
from bentray_service.errors import Forbidden
from bentray_service.settings import ServiceSettings


def identity(claims, **settings):
    return ClaimMapping(ServiceSettings(**settings)).identity(claims)


def test_each_user_is_a_tenant_without_a_table():
    found = identity({"sub": "alice@example.org"})
    assert (found.tenant, found.who, found.scopes) == (
        "alice@example.org",
        "alice@example.org",
        ("read", "write"),
    )
    # Neither the tenant of an open service nor a path.
    for user in ("local", "../x", "A B"):
        assert identity({"sub": user}).tenant.startswith("user-")


def test_the_order_of_the_settings_decides():
    tables = {"oidc_tenant_claim": "groups", "oidc_tenants": json.dumps({"b": "two", "a": "one"})}
    for groups in (["a", "b"], ["b", "a"]):
        assert identity({"sub": "x", "groups": groups}, **tables).tenant == "two"
    assert identity({"sub": "x", "groups": "a"}, **tables).tenant == "one"


@pytest.mark.parametrize(
    "claims", [{}, {"groups": []}, {"groups": ["c"]}, {"groups": {"a": 1}}, {"groups": 7}]
)
def test_without_a_known_group_nobody_enters(claims):
    tables = {"oidc_tenant_claim": "groups", "oidc_tenants": '{"a": "one"}'}
    with pytest.raises(Forbidden, match="groups"):
        identity({"sub": "x", **claims}, **tables)


@pytest.mark.parametrize("value", [["a", "b"], None, "local"])
def test_a_tenant_claim_names_one_tenant(value):
    with pytest.raises(Forbidden, match="org"):
        identity({"sub": "x", "org": value}, oidc_tenant_claim="org")
    assert identity({"sub": "x", "org": "a"}, oidc_tenant_claim="org").tenant == "a"


def test_roles_add_up():
    tables = {"oidc_role_claim": "realm.roles", "oidc_roles": '{"v": "read", "m": "metrics,read"}'}
    assert identity({"sub": "x", "realm": {"roles": ["v", "m"]}}, **tables).scopes == ("read", "metrics")
    with pytest.raises(Forbidden, match=r"realm\.roles"):
        identity({"sub": "x", "realm": {"roles": ["w"]}}, **tables)


def test_an_address_must_be_verified():
    with pytest.raises(Forbidden, match="email_verified"):
        identity({"sub": "x", "email": "a@b.c", "email_verified": False}, oidc_user_claim="email")
    assert identity({"sub": "x", "email": "a@b.c"}, oidc_user_claim="email").who == "a@b.c"
    for users in (["a", "b"], "", None):
        with pytest.raises(Forbidden, match="email"):
            identity({"sub": "x", "email": users}, oidc_user_claim="email")


def test_a_claim_with_dots_in_its_name_comes_first():
    claims = {"https://lab.example/groups": ["a"], "x.y": "1", "x": {"y": "2"}}
    assert values_of(claims, "https://lab.example/groups") == ("a",)
    assert values_of(claims, "x.y") == ("1",)
    assert values_of(claims, "x.z") == values_of(claims, "x.y.z") == ()
