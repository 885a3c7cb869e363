"""The score of a drive: counts and rates frame by frame, summed up over frames and windows."""
