"""Links that carry bytes: PTY, sockets, serial devices."""
