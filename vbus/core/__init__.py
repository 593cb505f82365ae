"""What everything else stands on: time, nets, state, values, options and errors."""
