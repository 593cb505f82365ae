"""Wall time to chip time: pacing, turns, patience, and who watches over them."""
