"""SIGKILL of the service at each step of a correction, and the memory of a correction of a large scan."""

import hashlib
from concurrent.futures import ThreadPoolExecutor

import httpx
import numpy as np
import pytest

from bentray_workers.files.dataset import read_dataset

from .machine import wait_until
from .test_uploads import PATIENCE_S, Service, a_scan

pytestmark = pytest.mark.nightly

CORRECTION = {"frequency_hz": 500000}
# Code that ends the service where it comes by.
KILL = "import os, signal\ndef killed(*_, **__):\n    os.kill(os.getpid(), signal.SIGKILL)\n"
FILE_IS_MOVED = f"{KILL}from bentray_service.files.store import Store\nStore.publish = killed\n"
ROW_IS_DUE = f"{KILL}from bentray_service.rows.stored_tables import Datasets\nDatasets.add = killed\n"
ANSWER_IS_DUE = f"{KILL}from bentray_service.routes import datasets\ndatasets.dataset_record = killed\n"


def corrected(service, here):
    """Ask for the correction."""
    return httpx.post(f"{service.url}{here}/corrections", json=CORRECTION, timeout=PATIENCE_S)


def scans(service):
    return httpx.get(f"{service.url}/v1/datasets").json()["datasets"]


def whole(service, scan, path):
    """Whether the file of a scan is as its row says; it is read from ``path``."""
    path.write_bytes(httpx.get(f"{service.url}{scan['links']['file']}", timeout=PATIENCE_S).content)
    assert hashlib.sha256(path.read_bytes()).hexdigest() == scan["sha256"]
    return read_dataset(path)


def test_a_killed_correction_leaves_the_scan_and_a_whole_copy_or_none(tmp_path):
    service = Service(tmp_path / "data")
    folder = tmp_path / "data" / "tenants" / "local"
    service.start()
    try:
        sent = httpx.post(
            f"{service.url}/v1/datasets",
            content=a_scan(tmp_path / "scan.h5", 40).read_bytes(),
            headers={"Content-Type": "application/x-hdf5"},
            timeout=PATIENCE_S,
        ).json()
        here, stored = sent["links"]["self"], folder / "datasets" / f"{sent['id']}.h5"
        before = stored.read_bytes()
        kept = 0
        for prelude, copies in ((FILE_IS_MOVED, 0), (ROW_IS_DUE, 0), (ANSWER_IS_DUE, 1), ("", 0)):
            service.kill()
            service.start(prelude)
            if prelude:
                with pytest.raises(httpx.TransportError):
                    corrected(service, here)
            else:
                killed_while_it_writes(service, here, folder)
            kept += copies
            service.kill()
            service.start()
            listed = scans(service)
            assert len(listed) == 1 + kept
            assert stored.read_bytes() == before
            assert len(list((folder / "datasets").iterdir())) == len(listed)
            assert not list((folder / "incoming").iterdir())
        made = corrected(service, here)
        assert made.status_code == 201, made.text
        original = read_dataset(stored)
        for scan in scans(service)[:-1]:
            copy = whole(service, scan, tmp_path / "copy.h5")
            assert copy.center_frequency_hz == CORRECTION["frequency_hz"]
            np.testing.assert_array_equal(copy.waveform.object, original.waveform.object)
    finally:
        service.kill()


def killed_while_it_writes(service, here, folder):
    """Kill the service once a part of the copy is on the disk."""
    with ThreadPoolExecutor(1) as pool:
        asked = pool.submit(corrected, service, here)
        wait_until(lambda: [one for one in folder.glob("incoming/*.reading/*.partial") if one.stat().st_size])
        service.kill()
        with pytest.raises(httpx.TransportError):
            asked.result()
