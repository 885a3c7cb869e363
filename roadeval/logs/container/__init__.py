"""The MCAP container: records, chunks, damage and recovery.

The `mcap` library reads and writes sound files, and its record classes are used here. The walk
through a file is our own because no package salvages MCAP: the library stops at the first record
that makes no sense, and has nothing for a log whose recorder was killed, whose chunks are damaged
or whose summary is missing or wrong.

- ``records``: bytes by position, records and chunks; ``summary``: what the file's end says
- ``scan``: what is really there, record by record; ``file``: a log's contents, and its damage
"""
