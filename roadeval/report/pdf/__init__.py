"""PDF files, typeset by Typst."""
