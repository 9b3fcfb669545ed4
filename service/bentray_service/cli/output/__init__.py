"""Output of commands: tables, JSON, progress bars and files."""
