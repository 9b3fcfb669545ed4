"""SART of a volume whose arrays fit no worker: in blocks of planes, with all arrays in files."""
