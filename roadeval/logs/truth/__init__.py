"""Labels for a log's images, wherever they lie: what they mean, and which image each belongs to."""
