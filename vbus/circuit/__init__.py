"""A circuit: chips, plants, glue and nets under one kernel, below its hosts."""
