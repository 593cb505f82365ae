"""Everything hosts did to a board: written down, read, played again and walked through."""
