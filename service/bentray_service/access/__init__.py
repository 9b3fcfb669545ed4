"""Access control: authentication, scopes, quotas, rate limits and the audit log."""
