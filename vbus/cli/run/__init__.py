"""Verbs that run boards and programs."""
