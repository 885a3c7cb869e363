"""Figures as files, and reports as PDFs and pages. Only this package knows Matplotlib and HTML.

A report is a sequence of blocks (`blocks`), which `sections` write of what a drive's tables tell
(`findings`); `pdf` sets it on paper, `page` makes a page for a browser of it.
"""
