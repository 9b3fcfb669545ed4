"""Who may do what: keys, proxies, scopes, rates, and the record of who did."""
