"""Verbs that compare, replay and break."""
