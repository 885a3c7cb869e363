"""The statistics: differences with intervals, within a drive and over drives, and corrections."""
