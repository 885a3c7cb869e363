"""Reports: figures as files, and documents as PDFs and pages. Nobody else knows Matplotlib or HTML.

A document is a sequence of blocks (`blocks`), which `sections` write of what a drive's tables tell
(`findings`); `pdf` sets it on paper, `page` makes a page for a browser of it.
"""
