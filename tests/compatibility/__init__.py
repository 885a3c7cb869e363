"""Results that earlier versions made, and that every later one reads: see `make`."""
