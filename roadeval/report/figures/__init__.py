"""Figures, drawn with Matplotlib.

To add one, add a file with a ``FIGURE`` (see `figure.FigureSpec`): every run writes it into its
results folder, in the order of the files' names. `charts` draws what only a PDF shows.
"""
