"""Parts of glue: gates, decoders, latches and counters between hosts and chips."""
