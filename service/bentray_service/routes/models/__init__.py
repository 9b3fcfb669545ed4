"""Pydantic models of the records of the REST interface."""
