"""A virtual hardware bus server: motion-control chips, bit for bit, for unmodified drivers."""
