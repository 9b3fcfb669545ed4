"""The client of the service, for Python programs and the command line."""

from .client import Client
from .errors import ClientError

__all__ = ["Client", "ClientError"]
