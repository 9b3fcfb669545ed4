"""TLS folders: those of the script are accepted, encrypt traffic, and reject other clients."""

import shutil
import subprocess
from pathlib import Path

import pytest
from distributed import LocalCluster

from bentray_kernels.errors import InvalidInput
from bentray_workers.cluster.connection import open_cluster
from bentray_workers.cluster.tls import AUTHORITY, CERTIFICATE, KEY, security_of

SCRIPT = Path(__file__).resolve().parents[3] / "deploy" / "certificates.sh"

pytestmark = pytest.mark.skipif(shutil.which("openssl") is None, reason="no openssl on the PATH")


def certificates(folder: Path) -> Path:
    subprocess.run([str(SCRIPT), str(folder), "2"], check=True, capture_output=True)
    return folder


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return certificates(tmp_path_factory.mktemp("tls") / "made")


def test_the_keys_are_for_their_owner_only_and_an_authority_is_not_replaced(folder: Path) -> None:
    assert {path.name for path in folder.iterdir()} == {AUTHORITY, CERTIFICATE, KEY, "authority-key.pem"}
    assert all(path.stat().st_mode & 0o077 == 0 for path in folder.iterdir())
    again = subprocess.run([str(SCRIPT), str(folder)], capture_output=True, text=True, check=False)
    assert again.returncode == 1
    assert "has an authority already" in again.stderr


def test_only_holders_of_a_certificate_are_served(folder: Path, tmp_path: Path) -> None:
    strangers = certificates(tmp_path / "others")
    with LocalCluster(
        n_workers=1,
        threads_per_worker=1,
        processes=False,
        security=security_of(folder),
        protocol="tls://",
        dashboard_address="127.0.0.1:0",
        scheduler_kwargs={"dashboard": False},
    ) as running:
        address = running.scheduler_address
        assert address.startswith("tls://")
        with open_cluster(address, tls=folder) as ours:
            assert ours.client.submit(sum, [1, 2]).result(timeout=60.0) == 3
        for tls in (strangers, None):
            with pytest.raises(InvalidInput, match="scheduler_address"):
                open_cluster(address, tls=tls, connect_timeout_s=1.0)
        with pytest.raises(InvalidInput, match="scheduler_address"):
            open_cluster(address.replace("tls://", "tcp://"), connect_timeout_s=1.0)


def test_certificates_encrypt_all_traffic(folder: Path) -> None:
    with pytest.raises(InvalidInput, match="with certificates"):
        open_cluster("tcp://127.0.0.1:1", tls=folder, connect_timeout_s=0.5)


@pytest.mark.parametrize("missing", [AUTHORITY, CERTIFICATE, KEY])
def test_a_missing_file_is_named(folder: Path, tmp_path: Path, missing: str) -> None:
    shutil.copytree(folder, tmp_path / "copy")
    (tmp_path / "copy" / missing).unlink()
    with pytest.raises(InvalidInput, match=f"without {missing}"):
        security_of(tmp_path / "copy")


def test_a_key_of_another_certificate_is_rejected(folder: Path, tmp_path: Path) -> None:
    shutil.copytree(folder, tmp_path / "copy")
    shutil.copy(certificates(tmp_path / "others") / KEY, tmp_path / "copy" / KEY)
    with pytest.raises(InvalidInput, match="tls"):
        security_of(tmp_path / "copy")
