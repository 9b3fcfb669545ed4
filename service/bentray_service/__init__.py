"""The Bentray service: REST interface, jobs, client and command line."""

from importlib.metadata import version

__version__ = version("bentray")
