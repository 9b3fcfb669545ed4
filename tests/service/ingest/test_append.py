"""Appending to an upload: bytes are kept, checksums are all or nothing, one writer at a time."""

import asyncio
import base64
import hashlib
import signal
import subprocess
import sys

import pytest

from bentray_kernels.errors import InvalidInput
from bentray_service.errors import Locked, TooLarge, UnknownChecksum, WrongChecksum
from bentray_service.ingest import receive as receiving
from bentray_service.ingest.receive import Checksum, UploadLocks, append, discard_unverified, received_bytes

BEGIN = b"begin "


def checksum(algorithm, body):
    digest = base64.b64encode(hashlib.new(algorithm, body).digest()).decode()
    return Checksum.from_header(f"{algorithm} {digest}")


async def stream(chunks, error):
    for chunk in chunks:
        yield chunk
    if error is not None:
        raise error


def run(path, *chunks, error=None, length=100, expected=None):
    if not path.exists():
        path.write_bytes(BEGIN)
    return asyncio.run(append(stream(chunks, error), path, len(BEGIN), length, expected))


@pytest.mark.parametrize("algorithm", [None, "sha256", "sha1", "md5"])
def test_a_piece_is_appended(tmp_path, algorithm):
    expected = None if algorithm is None else checksum(algorithm, b"middleend")
    assert run(tmp_path / "u", b"middle", b"end", expected=expected) == 15
    assert (tmp_path / "u").read_bytes() == b"begin middleend"


def test_a_wrong_checksum_takes_the_piece_back(tmp_path):
    with pytest.raises(WrongChecksum, match="sha256"):
        run(tmp_path / "u", b"middle", expected=checksum("sha256", b"muddle"))
    assert (tmp_path / "u").read_bytes() == BEGIN


def test_verified_bytes_survive_a_disconnect(tmp_path):
    for name, expected, left in (
        ("plain", None, b"begin middle"),
        ("checked", checksum("md5", b"middleend"), BEGIN),
    ):
        with pytest.raises(ConnectionError):
            run(tmp_path / name, b"middle", error=ConnectionError(), expected=expected)
        assert (tmp_path / name).read_bytes() == left


def test_more_than_the_length_is_rejected(tmp_path):
    with pytest.raises(TooLarge, match="Upload-Length of 10"):
        run(tmp_path / "u", b"123", b"45", length=10)
    assert (tmp_path / "u").read_bytes() == b"begin 123"


@pytest.mark.parametrize(
    ("header", "error"),
    [
        ("crc32 AAAA", UnknownChecksum),
        ("", UnknownChecksum),
        ("sha1", InvalidInput),
        ("sha1 AAAA", InvalidInput),
        ("sha1 ÄÖÜ", InvalidInput),
        ("md5 " + "A" * 1000, InvalidInput),
    ],
)
def test_rejects_invalid_checksums(header, error):
    with pytest.raises(error) as refused:
        Checksum.from_header(header)
    assert refused.value.field == "Upload-Checksum"


def test_one_writer_at_a_time_also_after_a_failure():
    hold = UploadLocks()

    def fail():
        with hold("a"), hold("b"):
            with pytest.raises(Locked, match="one request at a time"), hold("a"):
                raise AssertionError
            raise ConnectionError

    with pytest.raises(ConnectionError):
        fail()
    with hold("a"), hold("b"):
        pass


DIES = """
import asyncio, os, sys
from pathlib import Path
from bentray_service.ingest.receive import Checksum, append

async def stream():
    yield b"unverified"
    await asyncio.sleep(0)
    while path.stat().st_size < 16:
        # Chunks are written in batches; those that are large at once.
        yield bytes(8 * 2**20)
    os.kill(os.getpid(), 9)

path = Path(sys.argv[1])
checksum = Checksum.from_header(sys.argv[2]) if sys.argv[2:] else None
asyncio.run(append(stream(), path, 6, 2**40, checksum))
"""


@pytest.mark.parametrize("checked", [False, True])
def test_verified_bytes_survive_a_kill(tmp_path, checked):
    path = tmp_path / "u"
    path.write_bytes(BEGIN)
    said = [f"md5 {base64.b64encode(bytes(16)).decode()}"] if checked else []
    ended = subprocess.run([sys.executable, "-c", DIES, str(path), *said], timeout=60)
    assert ended.returncode == -signal.SIGKILL
    assert path.stat().st_size > 16
    if not checked:
        assert received_bytes(path) == path.stat().st_size
        return
    # Also before anything has been cut off.
    assert received_bytes(path) == len(BEGIN)
    discard_unverified(path)
    assert path.read_bytes() == BEGIN
    assert received_bytes(path) == len(BEGIN)
    assert list(tmp_path.iterdir()) == [path]


def test_a_piece_may_follow_one_that_was_not_verified(tmp_path):
    """It could not be cut off, for example."""
    path = tmp_path / "u"
    path.write_bytes(BEGIN + b"unverified")
    (tmp_path / "u.unverified").write_text(str(len(BEGIN)))
    assert run(path, b"middle") == 12
    assert path.read_bytes() == b"begin middle"
    assert received_bytes(path) == 12


def test_bytes_of_a_piece_do_not_count_while_it_is_checked(tmp_path, monkeypatch):
    monkeypatch.setattr(receiving, "BATCH_BYTES", 1)
    seen, path = [], tmp_path / "u"
    path.write_bytes(BEGIN)

    async def watched():
        for chunk in (b"mid", b"dle"):
            yield chunk
            await asyncio.sleep(0)
            seen.append(received_bytes(path))

    asyncio.run(append(watched(), path, len(BEGIN), 100, checksum("md5", b"middle")))
    assert seen == [len(BEGIN)] * 2
    assert received_bytes(path) == 12
