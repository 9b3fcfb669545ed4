"""From the bytes of a stranger to a canonical dataset file."""
