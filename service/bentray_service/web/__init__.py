"""The pages of the service; everything they load comes from here."""
