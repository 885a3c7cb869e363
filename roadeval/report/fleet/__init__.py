"""Reports of fleets: many drives judged together, and two fleets compared."""
