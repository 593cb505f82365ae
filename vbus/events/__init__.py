"""What happens on a board: packets of its buses, and conditions as people write them."""
