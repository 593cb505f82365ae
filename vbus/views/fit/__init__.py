"""Numbers of a motor from a recorded move."""
