"""Motors, loads and encoders."""
