"""LM628 and LM629 precision motion controllers."""
