"""The charts of a result's rows, in percent and percentage points.

To add a chart over the drive, add a file with a ``FIGURE`` (see `standard.OverDrive`).
"""
