"""Counts and rates against the truth (Eq. 24-29), and what can be said of them."""
