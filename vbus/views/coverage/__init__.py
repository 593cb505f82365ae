"""Which parts of a datasheet hosts have exercised."""
