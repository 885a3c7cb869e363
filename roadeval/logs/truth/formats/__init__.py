"""Label formats: files in which annotation tools keep shapes; ``FORMATS`` of each file here."""
