"""The records of the REST interface."""
