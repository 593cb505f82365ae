"""Cards: buses of addresses before chips, played once and then remembered."""
