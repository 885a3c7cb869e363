"""The MCAP container: records, chunks, damage and recovery."""
