"""Documents as pages for a browser: one file, or with files beside it. Nobody else knows HTML."""
