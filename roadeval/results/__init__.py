"""The results folder: tables, their schema, and the summary."""
