"""Reports: figures as files, and documents as PDFs and pages. Nobody else knows Typst or HTML.

A document is a sequence of blocks (`blocks`). `drive`, `comparison` and `fleet` write documents,
`sections` the parts of the first, and `figures` the paper's figures. `pdf` sets a document on
paper, `page` makes a page for a browser of it.
"""
