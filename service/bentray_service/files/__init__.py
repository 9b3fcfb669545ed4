"""The stored files of tenants: in the data folder or in a bucket, checked, cleaned up."""
