"""Zenoh: one way to open a session, and what the keys mean. Imports no part of a board."""
