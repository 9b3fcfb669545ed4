"""HTTP server, protocol limits, errors and the web page; no external resources are loaded."""
