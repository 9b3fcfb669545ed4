"""Refraction-corrected ultrasound computed tomography: scans, reconstructions, and the client of a service.

Names are loaded on first use, so that ``import bentray`` takes no time.
"""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from bentray_kernels.errors import InvalidInput
    from bentray_service import __version__
    from bentray_service.client import AsyncClient, Client, ClientError
    from bentray_service.interactive.comparison import Comparison
    from bentray_service.interactive.reconstruction import reconstruct, simulate
    from bentray_service.interactive.result import Result, load
    from bentray_service.interactive.scan import Scan, read
    from bentray_service.webhooks.signature import verify_webhook
else:
    # Where each name is defined.
    PLACES = {
        "AsyncClient": "bentray_service.client",
        "Client": "bentray_service.client",
        "ClientError": "bentray_service.client",
        "Comparison": "bentray_service.interactive.comparison",
        "InvalidInput": "bentray_kernels.errors",
        "Result": "bentray_service.interactive.result",
        "Scan": "bentray_service.interactive.scan",
        "__version__": "bentray_service",
        "load": "bentray_service.interactive.result",
        "read": "bentray_service.interactive.scan",
        "reconstruct": "bentray_service.interactive.reconstruction",
        "simulate": "bentray_service.interactive.reconstruction",
        "verify_webhook": "bentray_service.webhooks.signature",
    }

    def __getattr__(name: str) -> object:
        """Import the module of a name on its first use."""
        if name not in PLACES:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        from importlib import import_module

        value = globals()[name] = getattr(import_module(PLACES[name]), name)
        return value

    def __dir__() -> list[str]:
        """For completion, and the documentation."""
        return sorted(__all__)


__all__ = [
    "AsyncClient",
    "Client",
    "ClientError",
    "Comparison",
    "InvalidInput",
    "Result",
    "Scan",
    "__version__",
    "load",
    "read",
    "reconstruct",
    "simulate",
    "verify_webhook",
]
