"""Verbs that show what happens, or has happened."""
