"""What can be saved of a damaged file, such as one whose recorder was killed."""
