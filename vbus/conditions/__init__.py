"""Conditions on a board as people write them: one language, and what becomes of it in time."""
