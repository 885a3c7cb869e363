"""The sections of a drive's report, one file each: ``section(findings)`` yields its blocks."""
