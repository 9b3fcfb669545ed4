"""The database: its schema, and the rows of everything stored."""
