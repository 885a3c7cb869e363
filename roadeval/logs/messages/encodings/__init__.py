"""Message encodings, one file each, found by this folder.

A file defines ``ENCODING``, an `roadeval.logs.messages.encoding.Encoding`. Adding one is enough for
logs of that encoding to be described and replayed; files whose name begins with ``_`` are helpers.
"""
