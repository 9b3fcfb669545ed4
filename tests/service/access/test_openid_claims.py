"""Claims of a user become tenant, name and scopes, or a refusal."""

import json

import pytest

from bentray_service.access.openid import ClaimMapping, values_of
from bentray_service.errors import Forbidden
from bentray_service.rows.database import open_database
from bentray_service.rows.ids import Tenant
from bentray_service.rows.keys import ApiKey, ClaimedTenants, Keys
from bentray_service.settings import ServiceSettings

ISSUER = "https://id.example"


@pytest.fixture
def identity(tmp_path):
    database = open_database(f"sqlite:///{tmp_path / 'a.sqlite'}")
    Keys(database).add(ApiKey.new(), Tenant("clinic"), "scanner", ("read",))

    def of(claims, **settings):
        given = ServiceSettings(oidc_issuer=ISSUER, **settings)
        return ClaimMapping(given, ClaimedTenants(database)).identity(claims)

    yield of
    database.close()


def test_each_user_is_a_tenant_without_a_table(identity):
    claims = {"sub": "0815", "preferred_username": "alice", "name": "Alice"}
    found = identity(claims, oidc_user_claim="preferred_username")
    assert (found.who, found.scopes) == ("alice", ("read", "write"))
    # The subject counts: the provider may give a name to another user, and a user another name.
    for claim in ("name", "sub"):
        assert identity(claims, oidc_user_claim=claim).tenant == found.tenant
    assert identity({**claims, "sub": "4711"}, oidc_user_claim="preferred_username").tenant != found.tenant


@pytest.mark.parametrize("name", ["clinic", "local", "Clinic", "../clinic", "clinic\u0301", "\u0441linic"])
@pytest.mark.parametrize("claim", [None, "org"])
def test_a_claimed_name_is_never_the_tenant_of_a_key(identity, name, claim):
    user = identity({"sub": name, "org": name}, oidc_tenant_claim=claim)
    assert user.tenant not in ("clinic", "local")
    assert user.tenant != identity({"sub": "other", "org": "other"}, oidc_tenant_claim=claim).tenant
    # Only the operator gives users the tenant of a key.
    table = {"oidc_tenant_claim": "org", "oidc_tenants": '{"x": "clinic"}'}
    assert identity({"sub": name, "org": ["x"]}, **table).tenant == "clinic"


def test_the_order_of_the_settings_decides(identity):
    tables = {"oidc_tenant_claim": "groups", "oidc_tenants": json.dumps({"b": "two", "a": "one"})}
    for groups in (["a", "b"], ["b", "a"]):
        assert identity({"sub": "x", "groups": groups}, **tables).tenant == "two"
    assert identity({"sub": "x", "groups": "a"}, **tables).tenant == "one"


@pytest.mark.parametrize(
    "claims", [{}, {"groups": []}, {"groups": ["c"]}, {"groups": {"a": 1}}, {"groups": 7}]
)
def test_without_a_known_group_nobody_enters(identity, claims):
    tables = {"oidc_tenant_claim": "groups", "oidc_tenants": '{"a": "one"}'}
    with pytest.raises(Forbidden, match="groups"):
        identity({"sub": "x", **claims}, **tables)


@pytest.mark.parametrize("value", [["a", "b"], None, "", [], 7, {"a": 1}, "x" * 201])
def test_a_tenant_claim_names_one_tenant(identity, value):
    with pytest.raises(Forbidden, match="org"):
        identity({"sub": "x", "org": value}, oidc_tenant_claim="org")
    one, other = (identity({"sub": "x", "org": org}, oidc_tenant_claim="org") for org in ("a", ["a"]))
    assert one.tenant == other.tenant != identity({"sub": "a"}).tenant


def test_roles_add_up(identity):
    tables = {"oidc_role_claim": "realm.roles", "oidc_roles": '{"v": "read", "m": "metrics,read"}'}
    assert identity({"sub": "x", "realm": {"roles": ["v", "m"]}}, **tables).scopes == ("read", "metrics")
    with pytest.raises(Forbidden, match=r"realm\.roles"):
        identity({"sub": "x", "realm": {"roles": ["w"]}}, **tables)


@pytest.mark.parametrize(
    "verified",
    [None, False, 0, 1, 1.0, "true", "True", "false", "", [], [True], {}, {"a@b.c": True}, "absent"],
)
@pytest.mark.parametrize("use", ["user", "tenant", "role"])
def test_an_address_counts_only_with_email_verified_exactly_true(identity, verified, use):
    claims = {"sub": "x", "email": "a@b.c", **({} if verified == "absent" else {"email_verified": verified})}
    settings = {
        f"oidc_{use}_claim": "email",
        **({"oidc_roles": '{"a@b.c": "read"}'} if use == "role" else {}),
    }
    with pytest.raises(Forbidden, match="email_verified"):
        identity(claims, **settings)
    assert identity({**claims, "email_verified": True}, **settings).who == ("a@b.c" if use == "user" else "x")


BAD_NAMES = [None, "", " ", 7, True, {"a": 1}, [], ["a", "b"], " alice", "alice ", "alice\u00a0", "ali\nce"]
BAD_NAMES += ["ali\0ce", "alice\u200b", "\u202eecila", "\ud800", "a" * 256]


@pytest.mark.parametrize("name", BAD_NAMES, ids=ascii)
@pytest.mark.parametrize("claim", ["sub", "login"])
def test_names_that_are_none_or_look_like_another(identity, name, claim):
    with pytest.raises(Forbidden, match=claim):
        identity({"sub": "x", "login": "y", claim: name}, oidc_user_claim=claim)
    with pytest.raises(Forbidden, match="sub"):
        identity({"login": "y", "sub": name}, oidc_user_claim="login")


def test_a_claim_with_dots_in_its_name_comes_first():
    claims = {"https://lab.example/groups": ["a"], "x.y": "1", "x": {"y": "2"}}
    assert values_of(claims, "https://lab.example/groups") == ("a",)
    assert values_of(claims, "x.y") == ("1",)
    assert values_of(claims, "x.z") == values_of(claims, "x.y.z") == ()
