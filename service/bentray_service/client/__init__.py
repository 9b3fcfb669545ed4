"""The client of the service, for Python programs and the command line."""

from .async_client import AsyncClient
from .client import Client
from .errors import ClientError
from .results import Result

__all__ = ["AsyncClient", "Client", "ClientError", "Result"]
