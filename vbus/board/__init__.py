"""A board: chips, plants, wires and hosts, built from one file."""
