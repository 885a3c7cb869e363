"""Camera logs (MCAP) in and out. No other room knows MCAP.

A log goes from bytes to frames through its sub-rooms: ``container`` (records, chunks, damage),
``messages`` (pictures, whatever their encoding), ``topics`` (what there is, and which to replay)
and ``truth`` (labels wherever they lie: what they mean, which image each belongs to); `Log.frames`
puts them together. ``writing`` writes logs.
"""
