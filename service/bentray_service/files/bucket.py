"""Access to objects under one prefix of an S3 bucket with s3fs; errors become ``StorageUnavailable``."""

from __future__ import annotations

import errno
import logging
import math
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import aiohttp
from botocore.exceptions import BotoCoreError, ClientError
from s3fs import S3FileSystem

from ..errors import StorageUnavailable

log = logging.getLogger("bentray.storage")

# Size of the parts of an upload, larger for files with more than MAX_PARTS parts.
PART_BYTES = 16 * 2**20
PARTS_AT_ONCE = 4
MAX_PARTS = 10_000
# Maximum number of objects per S3 delete request.
MAX_REMOVED = 1000
# With retries, an unreachable bucket is given up after about ten seconds. The timeout of a file upload is
# longer, since the bucket may take minutes to assemble the parts.
CONNECT_S = 3.0
READ_S = 120.0
ANSWER_S = 10.0
TRIES = {"total_max_attempts": 2, "mode": "standard"}

# Errors of the local disk.
OWN = (errno.ENOSPC, errno.EDQUOT)


@dataclass(frozen=True)
class BucketObject:
    """An object: key below the prefix, size, and time of last modification, s since 1970."""

    key: str
    size: int
    changed: float


class Bucket:
    """A bucket; keys are relative to the prefix. Credentials come from the usual AWS variables."""

    def __init__(self, url: str, public_endpoint: str | None = None) -> None:
        """Args:
        url: ``s3://bucket`` or ``s3://bucket/prefix``.
        public_endpoint: address of the server for clients, by which ``part_url`` signs; None: that of the
            service.
        """
        self.url = url.rstrip("/")
        self._name, _, prefix = self.url.removeprefix("s3://").partition("/")
        self._prefix = f"{prefix}/" if prefix else ""
        self._s3 = _file_system(None)
        # The host is signed, too, so that addresses cannot be rewritten afterwards. Signing connects nowhere.
        self._signing = self._s3 if public_endpoint is None else _file_system(public_endpoint)

    def put(self, path: Path, key: str, metadata: Mapping[str, str]) -> None:
        """Upload a file with metadata; the object is complete or absent."""
        part = max(PART_BYTES, math.ceil(path.stat().st_size / MAX_PARTS))
        with self._watched():
            self._s3.put_file(str(path), self._place(key), chunksize=part, Metadata=dict(metadata))

    def get(self, key: str, path: Path) -> None:
        """Download an object; after an error the file may be incomplete.

        Raises:
            FileNotFoundError: when the object does not exist.
        """
        with self._watched(may_miss=True):
            self._s3.get_file(self._place(key), str(path))

    def put_metadata(self, key: str, metadata: Mapping[str, str]) -> None:
        """Write an empty object with metadata."""
        with self._watched():
            self._call("put_object", Key=self._prefix + key, Body=b"", Metadata=dict(metadata))

    def metadata(self, key: str) -> dict[str, str] | None:
        """Metadata of an object, with its ``size``; None if it does not exist."""
        try:
            with self._watched(may_miss=True):
                head = self._call("head_object", Key=self._prefix + key)
        except FileNotFoundError:
            return None
        return {**head["Metadata"], "size": str(head["ContentLength"])}

    def listed(self, under: str = "") -> Iterator[BucketObject]:
        """All objects whose keys start with ``under``."""
        more: dict[str, str] = {}
        while True:
            with self._watched():
                page = self._call("list_objects_v2", Prefix=self._prefix + under, **more)
            for one in page.get("Contents", ()):
                key = str(one["Key"]).removeprefix(self._prefix)
                yield BucketObject(key, int(one["Size"]), one["LastModified"].timestamp())
            if not page.get("IsTruncated"):
                return
            more = {"ContinuationToken": page["NextContinuationToken"]}

    def remove(self, keys: Collection[str]) -> None:
        """Delete objects; missing ones are ignored."""
        left = [{"Key": self._prefix + key} for key in keys]
        while left:
            batch, left = left[:MAX_REMOVED], left[MAX_REMOVED:]
            with self._watched():
                response = self._call("delete_objects", Delete={"Objects": batch, "Quiet": True})
                for failure in response.get("Errors", ()):
                    raise PermissionError(failure.get("Code"))

    def begin_parts(self, key: str) -> str:
        """Begin the upload of an object in parts by others; returns the id of the upload."""
        with self._watched():
            return str(self._call("create_multipart_upload", Key=self._prefix + key)["UploadId"])

    def part_url(self, key: str, upload: str, number: int, size: int, seconds: int) -> str:
        """Address for a PUT of one part of exactly ``size`` bytes, valid for some seconds."""
        signed = {"UploadId": upload, "PartNumber": number, "ContentLength": size}
        with self._watched():
            return str(self._signing.url(self._place(key), seconds, client_method="upload_part", **signed))

    def parts(self, key: str, upload: str) -> dict[int, tuple[str, int]] | None:
        """Tag and size of the received parts by number; None if the upload was completed or ended."""
        found: dict[int, tuple[str, int]] = {}
        more: dict[str, int] = {}
        try:
            while True:
                with self._watched(may_miss=True):
                    page = self._call("list_parts", Key=self._prefix + key, UploadId=upload, **more)
                for one in page.get("Parts", ()):
                    found[int(one["PartNumber"])] = (str(one["ETag"]), int(one["Size"]))
                if not page.get("IsTruncated"):
                    return found
                more = {"PartNumberMarker": page["NextPartNumberMarker"]}
        except FileNotFoundError:
            return None

    def complete_parts(self, key: str, upload: str, tags: Mapping[int, str]) -> None:
        """Assemble an object from its parts."""
        parts = [{"PartNumber": number, "ETag": tags[number]} for number in sorted(tags)]
        how = {"UploadId": upload, "MultipartUpload": {"Parts": parts}}
        with self._watched():
            self._s3.call_s3(
                "complete_multipart_upload", Bucket=self._name, Key=self._prefix + key, **how, timeout=READ_S
            )

    def abort_parts(self, key: str, upload: str) -> None:
        """Delete the parts of an upload; one that was completed or ended is ignored."""
        with suppress(FileNotFoundError), self._watched(may_miss=True):
            self._call("abort_multipart_upload", Key=self._prefix + key, UploadId=upload)

    def begun_parts(self, under: str) -> list[tuple[str, str, float]]:
        """Key, id and beginning, s since 1970, of uploads in parts whose keys start with ``under``."""
        with self._watched():
            page = self._call("list_multipart_uploads", Prefix=self._prefix + under)
        return [
            (str(one["Key"]).removeprefix(self._prefix), str(one["UploadId"]), one["Initiated"].timestamp())
            for one in page.get("Uploads", ())
        ]

    @contextmanager
    def _watched(self, *, may_miss: bool = False) -> Iterator[None]:
        """Turn errors into ``StorageUnavailable``, also a missing object unless ``may_miss``."""
        try:
            yield
        except (OSError, ValueError, BotoCoreError, ClientError, aiohttp.ClientError) as error:
            own = isinstance(error, OSError) and error.errno in OWN
            if own or (may_miss and isinstance(error, FileNotFoundError)):
                raise
            # Callers must not see the address and the key.
            log.warning("%s: %s: %s", self.url, type(error).__name__, error)
            raise StorageUnavailable(f"error of the bucket ({type(error).__name__})") from error

    def _call(self, method: str, **how: Any) -> Any:
        return self._s3.call_s3(method, Bucket=self._name, **how, timeout=ANSWER_S)

    def _place(self, key: str) -> str:
        return f"{self._name}/{self._prefix}{key}"


def _file_system(endpoint: str | None) -> S3FileSystem:
    """A client of an S3 server, by default of the one that the AWS variables name."""
    made = S3FileSystem(
        endpoint_url=endpoint,
        config_kwargs={
            "connect_timeout": CONNECT_S,
            "read_timeout": READ_S,
            "retries": TRIES,
            # Of presigned addresses, too; version 2 would not sign sizes.
            "signature_version": "s3v4",
        },
        default_block_size=PART_BYTES,
        max_concurrency=PARTS_AT_ONCE,
        use_listings_cache=False,
    )
    made.retries = 2
    return made
