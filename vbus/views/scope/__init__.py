"""What is seen of a board in a browser: lanes over time, live and afterwards."""
