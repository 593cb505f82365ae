"""The host's end: a bus over any link, and each chip's commands over that bus."""
