"""Reports and figures as PDFs, pictures and pages. Nobody else knows Typst or HTML.

A document is a sequence of blocks (`blocks`), which `sections` write of what a drive's tables tell
(`findings`); `pdf` sets it on paper, `page` makes a page for a browser of it.
"""
