"""Reports: figures as files, and PDFs of a drive or a comparison. Nobody else knows Matplotlib.

A document is a sequence of blocks (`blocks`). `drive` and `comparison` write the two documents,
`sections` the parts of the first, `figures` draws, and `pdf` sets a document on pages.
"""
