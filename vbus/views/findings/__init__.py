"""The violations of a run: reports of them, and those that are accepted."""
