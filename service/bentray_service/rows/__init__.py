"""The database: schema, migration, and the tables of everything stored."""
