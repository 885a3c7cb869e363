"""Labels for a log's images, in the log or beside it: their meaning, and the image of each."""
