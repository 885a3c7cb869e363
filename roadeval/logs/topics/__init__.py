"""The topics of a log: their kinds, labels, pairing, and which to replay."""
