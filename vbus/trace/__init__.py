"""Observers that record: trace hash, journal, waveforms."""
