"""The tables of a geometry field, and lookups in them."""
