"""Work with results: reports, comparisons, clips, and frames to look at."""
