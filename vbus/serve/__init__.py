"""Sessions of a running board, and the wall clock."""
