"""Streaming a body to disk: whole, counted, and with what came before a failure."""

import asyncio
import errno
import hashlib
import os

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bentray_service.errors import EmptyBody, StorageFull, TooLarge
from bentray_service.ingest import receive as receiving
from bentray_service.ingest.receive import receive

from ...effort import effort

LIMIT = 10**6


async def stream(chunks, error=None):
    for chunk in chunks:
        await asyncio.sleep(0)
        yield chunk
    if error is not None:
        raise error


def run(path, chunks, *, announced=None, limit=LIMIT, error=None):
    return asyncio.run(receive(stream(chunks, error), announced, path, limit, "a file"))


@given(chunks=st.lists(st.binary(max_size=40), min_size=1), batch=st.integers(1, 60))
@settings(max_examples=effort(20, 30), deadline=None)
def test_received_bytes_are_on_disk(tmp_path_factory, chunks, batch):
    path, body = tmp_path_factory.mktemp("r") / "body", b"".join(chunks)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(receiving, "BATCH_BYTES", batch)
        patch.setattr(receiving, "SYNC_BYTES", 2 * batch)
        if not body:
            with pytest.raises(EmptyBody):
                run(path, chunks)
            return
        received = run(path, chunks)
    assert path.read_bytes() == body
    assert (received.bytes, received.sha256) == (len(body), hashlib.sha256(body).hexdigest())


def test_tiny_chunks_are_bounded(tmp_path, monkeypatch):
    waiting = []
    write = receiving._BatchWriter._write
    monkeypatch.setattr(
        receiving._BatchWriter, "_write", lambda self, batch: (waiting.append(len(batch)), write(self, batch))
    )
    assert run(tmp_path / "body", [b"x"] * 5000).bytes == 5000
    assert max(waiting) <= receiving.BATCH_CHUNKS < 5000


def test_rejects_oversize_bodies(tmp_path):
    with pytest.raises(TooLarge, match="at most 10 bytes"):
        run(tmp_path / "announced", [b"x" * 11], announced=11, limit=10)
    assert not (tmp_path / "announced").exists()
    with pytest.raises(TooLarge, match="at most 10 bytes"):
        run(tmp_path / "counted", [b"x" * 6, b"y" * 6], limit=10)
    assert run(tmp_path / "just", [b"x" * 6, b"y" * 4], announced=10, limit=10).bytes == 10


def test_bytes_before_a_disconnect_are_kept(tmp_path, monkeypatch):
    monkeypatch.setattr(receiving, "BATCH_BYTES", 10)
    with pytest.raises(ConnectionError):
        run(tmp_path / "body", [b"a" * 7] * 5, error=ConnectionError())
    assert (tmp_path / "body").read_bytes() == b"a" * 35


@pytest.mark.parametrize("fails_at", [0, 1, 2])
def test_full_disk_is_reported_and_leaves_no_file(tmp_path, monkeypatch, fails_at):
    monkeypatch.setattr(receiving, "BATCH_BYTES", 10)
    path, real, calls = tmp_path / "body", os.open, []

    class Full:
        """A file whose disk is full from one write on."""

        def __init__(self, path):
            self.handle = real(path, os.O_CREAT | os.O_WRONLY)

        def write(self, data):
            calls.append(len(data))
            if len(calls) > fails_at:
                raise OSError(errno.ENOSPC, "No space left on device")
            return os.write(self.handle, data)

        def fileno(self):
            return self.handle

        def close(self):
            os.close(self.handle)

    async def write_body():
        file = Full(path)
        try:
            await receiving.write_body(stream([bytes([k]) * 10 for k in range(5)]), file, LIMIT, "", None)
        finally:
            file.close()

    with pytest.raises(StorageFull, match="no space"):
        asyncio.run(write_body())
    assert path.read_bytes() == b"".join(bytes([k]) * 10 for k in range(fails_at))
    assert len(calls) == fails_at + 1


def test_a_write_may_take_a_part_at_a_time(tmp_path):
    class Short:
        def __init__(self):
            self.body, self.file = b"", (tmp_path / "x").open("wb")

        def write(self, data):
            self.body += bytes(data[:3])
            return min(3, len(data))

        def fileno(self):
            return self.file.fileno()

    file = Short()
    asyncio.run(receiving.write_body(stream([b"0123456789"]), file, LIMIT, "", None))
    assert file.body == b"0123456789"
    file.file.close()
