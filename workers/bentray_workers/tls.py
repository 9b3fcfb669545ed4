"""TLS between scheduler, workers and clients: one folder with a certificate of our own authority."""

from __future__ import annotations

import ssl
from pathlib import Path

from distributed.security import Security

from bentray_kernels.errors import InvalidInput

AUTHORITY = "authority.pem"
CERTIFICATE = "certificate.pem"
KEY = "key.pem"


def security_of(folder: Path | None) -> Security:
    """What scheduler, workers and clients prove themselves with, and ask of each other.

    Whoever holds a certificate of the authority is trusted, in any role: the key of the authority decides who
    may run code on the workers. Names of machines are not compared, as Dask never does.

    Args:
        folder: with ``authority.pem``, ``certificate.pem`` and ``key.pem``, as ``deploy/certificates.sh``
            makes it; None: what Dask's own configuration says, which is no TLS unless it was changed.

    Raises:
        InvalidInput: when a file is missing, or certificate and key do not belong together.
    """
    if folder is None:
        return Security()
    paths = {name: folder / name for name in (AUTHORITY, CERTIFICATE, KEY)}
    for name, path in paths.items():
        if not path.is_file():
            raise InvalidInput("tls", f"{folder} (without {name})", "a folder with " + ", ".join(paths))
    try:
        context = ssl.create_default_context(cafile=str(paths[AUTHORITY]))
        context.load_cert_chain(paths[CERTIFICATE], paths[KEY])
    except OSError as error:
        raise InvalidInput(
            "tls", f"{folder} ({error.strerror or error})", "a certificate, its key and its authority"
        ) from error
    roles = {
        f"tls_{role}_{part}": str(paths[name])
        for role in ("scheduler", "worker", "client")
        for part, name in (("cert", CERTIFICATE), ("key", KEY))
    }
    return Security(tls_ca_file=str(paths[AUTHORITY]), require_encryption=True, **roles)
