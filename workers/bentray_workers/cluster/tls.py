"""TLS between scheduler, workers and clients: certificates of a folder, or a new one in memory."""

import ssl
from datetime import datetime
from pathlib import Path

from cryptography import x509
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.hashes import SHA256
from cryptography.hazmat.primitives.serialization import Encoding, NoEncryption, PrivateFormat
from cryptography.x509.oid import NameOID
from distributed.security import Security

from bentray_kernels.errors import InvalidInput

AUTHORITY = "authority.pem"
CERTIFICATE = "certificate.pem"
KEY = "key.pem"

# A key in memory needs no expiry, and a clock that is set back must not invalidate it.
ALWAYS = datetime(2000, 1, 1), datetime(9999, 12, 31, 23, 59, 59)


def security_of(folder: Path | None) -> Security:
    """Mutual authentication of scheduler, workers and clients.

    Any holder of a certificate of the authority is trusted, in any role: the key of the authority decides who
    may run code on the workers. Host names are not checked, as Dask never does.

    Args:
        folder: with ``authority.pem``, ``certificate.pem`` and ``key.pem``, as ``deploy/certificates.sh``
            makes it; None: the configuration of Dask, which is no TLS by default.

    Raises:
        InvalidInput: for a missing file, or a certificate and key that do not match.
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
    return _mutual(*(str(paths[name]) for name in (AUTHORITY, CERTIFICATE, KEY)))


def own_security() -> Security:
    """Authentication by a new certificate of this process.

    Key and certificate stay in memory; worker processes get them through a pipe.
    """
    key = ec.generate_private_key(ec.SECP256R1())
    name = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, "bentray-embedded")])
    made = (
        x509.CertificateBuilder(name, name, key.public_key(), x509.random_serial_number(), *ALWAYS)
        .add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
        .sign(key, SHA256())
    )
    certificate = made.public_bytes(Encoding.PEM).decode()
    secret = key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption()).decode()
    return _mutual(certificate, certificate, secret)


def _mutual(authority: str, certificate: str, key: str) -> Security:
    """One certificate and key for every role."""
    roles = "scheduler", "worker", "client"
    pairs = {f"tls_{role}_cert": certificate for role in roles} | {f"tls_{role}_key": key for role in roles}
    return Security(tls_ca_file=authority, require_encryption=True, **pairs)
