"""What is wrong with a board file beyond the single key, each mistake with its line."""
