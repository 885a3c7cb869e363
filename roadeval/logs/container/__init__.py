"""The MCAP container: records, chunks, damage and recovery.

The `mcap` library reads and writes sound files, and its record classes are used here. The walk
through a file is our own because no package salvages MCAP: the library stops at the first record
that makes no sense, and has nothing for a log whose recorder was killed, whose chunks are damaged
or whose summary is missing or wrong. Speed is not the reason: the library reads the summary of a
sound log in a fraction of the time (0.2 ms against 1.3 ms of a log of 8 MB), because the walk looks
at every record's head.

- ``readers``: bytes by position; ``records``: a record from its bytes; ``chunks`` and
  ``compression``: the records of a chunk
- ``summary``: what the file's end says; ``scan``: what is really there, record by record
- ``recovery``: damaged chunks, and the next record that makes sense
- ``file``: a file's table of contents; ``damage``: what is wrong with it, in sentences
"""
