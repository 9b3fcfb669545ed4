"""Stored files of tenants in the data folder or a bucket, with checksums and clean-up."""
