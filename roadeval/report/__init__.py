"""Reports: figures as files, and documents as PDFs and pages. Nobody else knows Matplotlib or HTML.

A document is a sequence of blocks (`blocks`). `drive`, `comparison` and `fleet` write documents,
`sections` the parts of the first, and `figures` draws. `pdf` sets a document on paper, `page` makes
a page for a browser of it.
"""
