"""Figures and PDFs. Nobody else knows Matplotlib or the typesetter."""
