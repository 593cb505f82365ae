"""Observers, and what bus cycles mean: journal, waveforms, captures, findings, coverage."""
