"""Recovery of the readable part of a damaged file, such as one whose recorder was killed."""
