"""The MCAP container: records, chunks, damage and recovery.

The `mcap` library's record classes are used here. The walk through a file is our own because no
package salvages MCAP: the library stops at the first record that makes no sense, and has nothing
for a log whose recorder was killed, whose chunks are damaged or whose summary is missing or wrong.
A sound log takes the same walk, for two reasons: only a walk tells that a log is sound, and the
library makes an object of each message of an index (82 ms of 100,000 messages, here 0.05 ms) and
of each entry of a chunk's map (a summary of 2,000 chunks takes four times as long).

- ``records``: bytes by position, records and chunks, and what the file's end says
- ``scan``: what is really there, record by record, across damage
- ``file``: a log's contents, and its damage
"""
