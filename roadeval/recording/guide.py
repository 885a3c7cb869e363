"""."""
def text(layout):
    return f"# {layout.drive}"
