"""Verbs of boards on several computers."""
