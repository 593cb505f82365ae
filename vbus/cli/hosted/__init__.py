"""Programs that run beside a board: started, watched and ended."""
