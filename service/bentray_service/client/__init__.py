"""The client of the service, for Python programs and the command line."""

from ..interactive.result import Result
from .client import AsyncClient, Client
from .errors import ClientError

__all__ = ["AsyncClient", "Client", "ClientError", "Result"]
