"""Which charts are made of which rows; in percent and percentage points.

To add a chart over the drive, add a file with a ``FIGURE`` (see `rates.OverDrive`).
"""
