"""Settings: read from the environment, rejected with a message."""

from pathlib import Path

import pytest
from sqlalchemy.engine import make_url

from bentray_kernels.errors import InvalidInput
from bentray_service.settings import ServiceSettings


def test_every_field_is_described():
    assert [name for name, field in ServiceSettings.model_fields.items() if not field.description] == []


def test_environment_is_read(monkeypatch, tmp_path):
    monkeypatch.setenv("BENTRAY_PORT", "8123")
    monkeypatch.setenv("BENTRAY_DATA_DIR", str(tmp_path))
    monkeypatch.setenv("DASK_SCHEDULER_ADDRESS", "tcp://scheduler:8786")
    settings = ServiceSettings.load()
    assert (settings.port, settings.dask_scheduler_address) == (8123, "tcp://scheduler:8786")
    assert settings.database == f"sqlite:///{tmp_path / 'bentray.sqlite'}"


def test_explicit_settings_take_precedence(monkeypatch):
    monkeypatch.setenv("BENTRAY_PORT", "8123")
    assert ServiceSettings.load(port=9).port == 9
    assert ServiceSettings.load(database_url="postgresql://db/x").database == "postgresql://db/x"
    assert ServiceSettings.load(data_dir=Path("x")).data_dir == Path("x")


@pytest.mark.parametrize(
    ("variable", "value", "said"),
    [
        (
            "BENTRAY_MAX_TENANT_BYTE",
            "9",
            "no such setting; the nearest is BENTRAY_MAX_TENANT_BYTES.",
        ),
        ("BENTRAY_OPENID_ISSUER", "x", "no such setting; the nearest is BENTRAY_OIDC_ISSUER."),
        ("bentray_zzz", "x", "no such setting."),
        ("BENTRAY_PORT", "9000", "--port 8000 is given and overrides it."),
        ("BENTRAY_PORT", "8000", None),
        ("bentray_keep_days", "9", None),
        ("BENTRAY_DEVICE", "cpu", None),
        ("BENTRAY_PUBLISH", "0.0.0.0:80", None),
        ("DASK_SCHEDULER_ADDRESS", "x", None),
    ],
)
def test_a_variable_without_effect_is_named(variable, value, said):
    found = list(ServiceSettings.unused_variables({variable: value, "PATH": "/bin"}, {"port": "--port 8000"}))
    assert found == ([f"{variable} has no effect: {said}"] if said else [])


@pytest.mark.parametrize(("name", "value"), [("BENTRAY_PORT", "http"), ("BENTRAY_MAX_UPLOAD_BYTES", "-1")])
def test_a_wrong_value_names_its_variable(monkeypatch, name, value):
    monkeypatch.setenv(name, value)
    with pytest.raises(InvalidInput) as caught:
        ServiceSettings.load()
    assert caught.value.field == name
    assert value in caught.value.value


def test_the_password_of_the_database_comes_from_its_file(tmp_path):
    (tmp_path / "password").write_text("p@ss/word:#?\n")
    settings = ServiceSettings(
        database_url="postgresql+psycopg://bentray@db:5432/bentray",
        database_password_file=tmp_path / "password",
    )
    address = make_url(settings.database)
    assert (address.password, address.host, address.database) == ("p@ss/word:#?", "db", "bentray")
    assert "p@ss" not in repr(settings)


@pytest.mark.parametrize("given", [{"database_url": "postgresql+psycopg://a@b/c"}, {}])
def test_a_password_that_cannot_be_read_or_used_is_rejected(tmp_path, given):
    with pytest.raises(InvalidInput, match=r"^BENTRAY_DATABASE_PASSWORD_FILE: "):
        _ = ServiceSettings(**given, database_password_file=tmp_path / "absent").database
