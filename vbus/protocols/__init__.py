"""Wire formats a host speaks; no I/O, no chip knowledge."""
