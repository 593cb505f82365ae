"""Campaigns: a host again and again, each time in a world in which one thing is broken."""
