"""Nodes of a board in several processes: their messages, their peers, their time."""
