"""Webhooks: signed messages to an address of the client when a job ends."""
