"""Camera logs (MCAP), read and written. No other room knows MCAP.

A log goes from bytes to frames through its sub-rooms: ``container`` (records, chunks, damage),
``messages`` (pictures in every encoding), ``topics`` (the content of a log, and the choice of
topics to replay) and ``truth`` (labels, their meaning and their images). `Log.frames` puts them
together. ``writing`` writes logs.
"""
