"""The results of a fleet: a record a drive, and the tables that are made of all records."""
