"""What a host did in a run and what its motors did, to be compared with another run."""
