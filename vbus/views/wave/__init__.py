"""What happens on a board, as waveforms."""
