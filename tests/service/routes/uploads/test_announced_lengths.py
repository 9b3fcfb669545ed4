"""A body that is announced to be too large is rejected before any of it comes, by its true reason."""

import pytest

from ....raw_http import exchange


@pytest.mark.parametrize(
    ("path", "media_type"),
    [
        ("/v1/jobs", "application/json"),
        ("/v1/plans", "application/json"),
        ("/v1/batches", "application/json"),
        ("/v1/datasets", "application/x-hdf5"),
        ("/v1/volumes?spacing_m=0.001", "application/octet-stream"),
        ("/v1/meshes", "application/octet-stream"),
    ],
)
def test_a_body_that_is_announced_too_large_is_not_waited_for(serve, path, media_type) -> None:
    port = int(serve(max_upload_bytes=10**6, max_tenant_bytes=10**7).rpartition(":")[2])
    head = [f"POST {path} HTTP/1.1", f"Content-Type: {media_type}", f"Content-Length: {10**13}"]
    statuses, answer = exchange(port, head, b"{", ends=False)
    assert statuses == [413], answer
    assert b"10000000000000 bytes" in answer
