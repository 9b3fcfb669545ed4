"""docker-compose.yml: valid, only the edge published, locked down, pinned; and its scripts."""

import json
import os
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest
import typer
import yaml

from bentray_service.cli import app
from bentray_service.rows.keys import ApiKey
from bentray_service.settings import OF_COMPOSE, OF_OTHER_PARTS, ServiceSettings
from bentray_workers.cluster.dask_settings import SETTINGS

from . import compose

DEPLOY = compose.ROOT / "deploy"
OURS = ("scheduler", "worker", "service")
FIELDS = {f"BENTRAY_{name.upper()}" for name in ServiceSettings.model_fields} - {
    "BENTRAY_DASK_SCHEDULER_ADDRESS"
} | {"DASK_SCHEDULER_ADDRESS"}


@pytest.fixture(scope="module")
def file() -> dict[str, Any]:
    return compose.read()


def client() -> list[str] | None:
    """The command of a compose client, if there is one."""
    for words in (["docker", "compose"], ["docker-compose"]):
        if shutil.which(words[0]) is None:
            continue
        if subprocess.run([*words, "version"], capture_output=True, check=False).returncode == 0:
            return words
    return None


def test_compose_file_is_valid(tmp_path: Path) -> None:
    words = client()
    if words is None:
        pytest.skip("no compose client here: apt-get install docker-compose")
    for name in ("docker-compose.yml", "deploy"):
        source = compose.ROOT / name
        (shutil.copytree if source.is_dir() else shutil.copy)(source, tmp_path / name)
    for files in ([], ["-f", "docker-compose.yml", "-f", "deploy/tls.yml"]):
        command = [*words, *files, "config", "-q"]
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr


def test_tls_encrypts_every_connection_and_changes_nothing_else(file: dict[str, Any]) -> None:
    secured = compose.read(compose.TLS)
    for name in OURS:
        part, before = secured["services"][name], file["services"][name]
        assert "tcp://" not in str(part)
        assert set(part["secrets"]) - set(before.get("secrets", [])) == {
            "authority.pem",
            "certificate.pem",
            "key.pem",
        }
        for unchanged in ("networks", "read_only", "cap_drop", "security_opt", "mem_limit"):
            assert part[unchanged] == before[unchanged]
    assert secured["services"]["database"] == file["services"]["database"]


def test_only_the_edge_is_published_and_on_loopback(file: dict[str, Any]) -> None:
    published = {name: part["ports"] for name, part in file["services"].items() if "ports" in part}
    assert published == {
        "edge": ["127.0.0.1:8000:8080", "127.0.0.1:8443:8443"],
        "grafana": ["127.0.0.1:3000:3000"],
    }
    internal = {name for name, network in file["networks"].items() if network.get("internal")}
    for name in ("scheduler", "worker", "database", "prometheus"):
        assert set(file["services"][name]["networks"]) <= internal
        assert "network_mode" not in file["services"][name]
    for name, others in {
        "worker": ["database", "prometheus"],
        "prometheus": ["database", "scheduler"],
    }.items():
        for other in others:
            networks = [set(file["services"][part]["networks"]) for part in (name, other)]
            assert not networks[0] & networks[1]


def test_the_edge_reads_files_that_are_mounted(file: dict[str, Any]) -> None:
    part, text = file["services"]["edge"], (DEPLOY / "nginx.conf").read_text()
    (mounted,) = part["volumes"]
    assert mounted == f"./deploy/nginx.conf:{part['entrypoint'][2]}:ro"
    folder = Path(part["entrypoint"][2]).parent
    read = {str(folder / name) for name in re.findall(r"ssl_certificate(?:_key)? (\S+);", text)}
    assert {secret["target"] for secret in part["secrets"]} == read
    published = {words.rpartition(":")[2] for words in part["ports"]}
    assert set(re.findall(r"listen (\d+) ", text)) == published
    command = file["services"]["service"]["command"]
    assert f"set $service service:{command[command.index('--port') + 1]};" in text
    (files,) = re.findall(r"worker_connections (\d+);", text)
    assert int(files) < part["ulimits"]["nofile"]
    # In the temporary folders that the container may write.
    assert all(path.startswith("/tmp/") for path in re.findall(r"(?:pid|_temp_path) (\S+);", text))


def test_every_part_is_locked_down_and_limited(file: dict[str, Any]) -> None:
    for name, part in file["services"].items():
        assert part["read_only"] is True, name
        assert part["cap_drop"] == ["ALL"], name
        assert part["security_opt"] == ["no-new-privileges:true"], name
        assert any(folder.startswith("/tmp:") for folder in part["tmpfs"]), name
        assert part["mem_limit"], name
        assert part["cpus"], name
        assert part["healthcheck"]["test"][0] == "CMD", name
        assert part["restart"] == "unless-stopped", name
        assert "privileged" not in part, name
        assert part["logging"]["options"].keys() == {"max-size", "max-file"}, name
    for name in OURS:
        # One that hangs is restarted, without anything that only some engines have.
        test = file["services"][name]["healthcheck"]["test"]
        assert test[:5] == ["CMD", "python", "-m", "bentray_service.healthcheck", "--restart-after"]
        assert "init" not in file["services"][name]
    assert file["services"]["service"]["healthcheck"]["test"][6:] == [], "liveness, not readiness"


def test_images_are_pinned_and_ours_runs_as_an_ordinary_user(file: dict[str, Any]) -> None:
    text = (DEPLOY / "Dockerfile").read_text()
    images = [part["image"] for part in file["services"].values()] + re.findall(r"^FROM (\S+)", text, re.M)
    assert all(re.search(r":v?\d+\.\d+[.\w-]*$", image) for image in images), images
    assert re.search(r"^FROM python:3\.11\.\d+-slim", text, re.M)
    assert re.findall(r"^USER (\S+)", text, re.M)[-1] == "bentray"
    assert file["services"]["database"]["user"] != "root"
    for copied in re.findall(r"^COPY (?!--from)(.+) \S+$", text, re.M):
        for name in copied.split():
            # Built pages are copied only if there are some.
            name = name.replace("buil[d]", "build/docs")
            assert (compose.ROOT / name).exists() or name == "build/docs"
            assert f"!{name}" in (DEPLOY / "Dockerfile.dockerignore").read_text().split()


def test_monitoring_is_optional_and_finds_what_it_needs(file: dict[str, Any]) -> None:
    prometheus, grafana = file["services"]["prometheus"], file["services"]["grafana"]
    assert prometheus["profiles"] == grafana["profiles"] == ["monitoring"]
    scrape = yaml.safe_load((DEPLOY / "prometheus/prometheus.yml").read_text())["scrape_configs"][0]
    assert scrape["authorization"]["credentials_file"] == f"/run/secrets/{prometheus['secrets'][0]}"
    assert scrape["static_configs"] == [{"targets": ["service:8000"]}]
    assert set(prometheus["networks"]) & set(file["services"]["service"]["networks"])
    # Everything that Grafana reads is mounted where the other file expects it.
    mounts = {words.split(":")[1]: words.split(":")[0] for words in grafana["volumes"]}
    for inside, here in mounts.items():
        assert inside == "/var/lib/grafana" or (compose.ROOT / here).exists()
    provisioned = compose.ROOT / mounts["/etc/grafana/provisioning"]
    (source,) = yaml.safe_load((provisioned / "datasources/prometheus.yml").read_text())["datasources"]
    assert source["url"] == "http://prometheus:9090"
    (provider,) = yaml.safe_load((provisioned / "dashboards/bentray.yml").read_text())["providers"]
    assert f"{provider['options']['path']}/dashboard.json" in mounts


def test_numba_can_write_its_cache(file: dict[str, Any]) -> None:
    cache = re.search(r"NUMBA_CACHE_DIR=(\S+)", (DEPLOY / "Dockerfile").read_text())
    assert cache is not None
    for name in OURS:
        assert any(folder.startswith(f"{cache[1]}:uid=1000") for folder in file["services"][name]["tmpfs"])


def test_no_password_is_in_the_file_and_git_ignores_where_it_is(file: dict[str, Any]) -> None:
    text = compose.FILE.read_text()
    assert not re.search(r"postgresql\+psycopg://\w+:", text)
    assert "POSTGRES_PASSWORD:" not in text
    ours = {"database-password", "first-key", "metrics-key", "grafana-password"}
    assert set(file["secrets"]) == ours | {"edge-certificate", "edge-key"}
    assert "GF_SECURITY_ADMIN_PASSWORD:" not in text
    for secret in file["secrets"].values():
        path = secret["file"].removeprefix("./")
        ignored = subprocess.run(["git", "check-ignore", "-q", path], cwd=compose.ROOT, check=False)
        if (compose.ROOT / ".git").exists():
            assert ignored.returncode == 0


def test_every_variable_and_setting_is_known(file: dict[str, Any]) -> None:
    told = (DEPLOY / "README.md").read_text()
    assert [name for name in sorted(compose.variables() - FIELDS) if f"`{name}`" not in told] == []
    assert set(file["services"]["service"]["environment"]) <= FIELDS
    assert compose.variables() - FIELDS - OF_OTHER_PARTS == OF_COMPOSE


def test_every_setting_in_dotenv_reaches_the_service(file: dict[str, Any], tmp_path: Path) -> None:
    service = file["services"]["service"]
    assert service["env_file"] == [{"path": ".env", "required": False}]
    # Variables of the file override those of .env, so each must take its value from there.
    fixed = {name: value for name, value in service["environment"].items() if value is not None}
    assert set(fixed) <= compose.variables()
    # What options of the command fix is said at the start.
    assert service["command"] == [
        "bentray",
        "serve",
        "--host",
        "0.0.0.0",
        "--port",
        "8000",
        "--data",
        "/data",
    ]
    words = client()
    if words is None:
        pytest.skip("no compose client here, so .env was not read by one: apt-get install docker-compose")
    shutil.copy(compose.FILE, tmp_path)
    (tmp_path / ".env").write_text("".join(f"{name}=here\n" for name in sorted(FIELDS)))
    command = [*words, "config", "--format", "json"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True)
    reached = json.loads(done.stdout)["services"]["service"]["environment"]
    assert {name: reached.get(name) for name in FIELDS} == dict.fromkeys(FIELDS, "here")


def test_the_scheduler_runs_under_our_settings_of_dask(file: dict[str, Any]) -> None:
    pod = yaml.safe_load((DEPLOY / "kubernetes" / "cluster.yaml").read_text())["spec"]["scheduler"]["spec"]
    variables = {one["name"]: one["value"] for one in pod["containers"][0]["env"]}
    asked = {name: value for name, value in SETTINGS.items() if name.startswith("distributed.scheduler.")}
    assert asked
    for name, value in asked.items():
        variable = "DASK_" + name.upper().replace(".", "__").replace("-", "_")
        assert file["services"]["scheduler"]["environment"][variable] == str(value)
        if not name.endswith("routes"):  # the operator asks for idle workers by one
            assert variables[variable] == str(value)


@pytest.mark.parametrize("part", ["worker", "service"])
def test_commands_of_ours_parse(file: dict[str, Any], part: str) -> None:
    program, command, *words = file["services"][part]["command"]
    assert program == "bentray"
    typer.main.get_command(app).commands[command].make_context(command, words)  # type: ignore[attr-defined]


def test_password_and_key_are_made_once_and_closed_to_others(tmp_path: Path) -> None:
    folder = tmp_path / "secrets"
    for _ in range(2):
        subprocess.run([str(DEPLOY / "secrets.sh"), str(folder)], check=True, capture_output=True)
    found = [(folder / name).read_text() for name in ("database-password", "first-key")]
    assert re.fullmatch("[0-9a-f]{64}", found[0])
    assert ApiKey.from_text(found[1]) is not None
    assert folder.stat().st_mode & 0o777 == 0o700
    subprocess.run([str(DEPLOY / "secrets.sh"), str(tmp_path / "more")], check=True)
    for name, before in zip(("database-password", "first-key"), found, strict=True):
        assert (tmp_path / "more" / name).read_text() != before


def test_compiled_kernels_are_copied_once_to_the_numba_cache(tmp_path: Path) -> None:
    compiled, cache = tmp_path / "compiled", tmp_path / "cache"
    (compiled / "folder").mkdir(parents=True)
    (compiled / "folder" / "kernel.nbc").write_text("compiled with the image")
    cache.mkdir()
    environment = {**os.environ, "BENTRAY_COMPILED": str(compiled), "NUMBA_CACHE_DIR": str(cache)}
    for content in ("compiled with the image", "compiled since"):
        done = subprocess.run(
            [str(DEPLOY / "entrypoint.sh"), "echo", "the command, as it is"],
            env=environment,
            capture_output=True,
            text=True,
            check=True,
        )
        assert done.stdout == "the command, as it is\n"
        assert (cache / "folder" / "kernel.nbc").read_text() == content
        (cache / "folder" / "kernel.nbc").write_text("compiled since")


def test_a_cache_that_cannot_be_written_is_in_a_temporary_folder(tmp_path: Path) -> None:
    (tmp_path / "compiled").mkdir()
    (tmp_path / "compiled" / "kernel.nbc").write_text("compiled with the image")
    (tmp_path / "file").touch()
    away = tmp_path / "file" / "cache"
    environment = {
        **os.environ,
        "BENTRAY_COMPILED": str(tmp_path / "compiled"),
        "NUMBA_CACHE_DIR": str(away),
        "TMPDIR": str(tmp_path),
    }
    words = [str(DEPLOY / "entrypoint.sh"), "sh", "-c", "echo $NUMBA_CACHE_DIR $XDG_CACHE_HOME $MPLCONFIGDIR"]
    done = subprocess.run(words, env=environment, capture_output=True, text=True, check=True)
    cache, home, drawing = done.stdout.split()
    assert Path(cache).parent == tmp_path
    assert (Path(cache) / "kernel.nbc").read_text() == "compiled with the image"
    assert (home, drawing) == (cache, f"{cache}/matplotlib")
    assert done.stderr == f"bentray: {away} cannot be written; compiled kernels are in {cache}\n"


@pytest.mark.parametrize(
    ("version", "memory", "said"),
    [
        ("2.24.0", 16e9, []),
        ("v2.23.3", 16e9, ["docker compose 2.23.3; 2.24 or later reads .env for the service"]),
        ("", 16e9, ["no docker compose; install its plugin, 2.24 or later"]),
        ("5.0.1", 4e9, ["4000 MB of memory; a service with one worker needs 8 GB"]),
    ],
)
def test_the_check_says_what_a_machine_lacks(
    tmp_path: Path, version: str, memory: float, said: list[str]
) -> None:
    docker = tmp_path / "docker"
    docker.write_text(
        f'#!/bin/sh\ncase "$*" in *version*) echo {version};; *format*) echo {memory:.0f};; esac\n'
    )
    docker.chmod(0o755)
    subprocess.run([str(DEPLOY / "secrets.sh"), str(tmp_path)], check=True)
    environment = {
        **os.environ,
        "PATH": f"{tmp_path}:{os.environ['PATH']}",
        "BENTRAY_FIRST_KEY_SECRET": str(tmp_path / "first-key"),
        "BENTRAY_DATABASE_PASSWORD_SECRET": str(tmp_path / "database-password"),
        "BENTRAY_EDGE_CERTIFICATE_SECRET": str(tmp_path / "edge-certificate.pem"),
        "BENTRAY_EDGE_KEY_SECRET": str(tmp_path / "edge-key.pem"),
    }
    done = subprocess.run(
        [str(DEPLOY / "check.sh")], env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == bool(said)
    assert [line.removeprefix("check.sh: ")[: len(said[0])] for line in done.stderr.splitlines()] == said
