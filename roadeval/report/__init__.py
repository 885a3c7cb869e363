"""Figures as files, and reports as PDFs and pages. Only this package knows Matplotlib and HTML.

A report is a sequence of blocks (`blocks`). `sections` makes them from the tables of a drive
(`findings`). `pdf` sets a report on paper, and `page` makes it a page for a browser.
"""
