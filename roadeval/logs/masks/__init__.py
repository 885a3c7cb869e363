"""Road masks that lie beside the log: in a folder, or in another log."""
