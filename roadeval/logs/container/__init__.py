"""The MCAP container: records, chunks, damage and recovery.

The record classes are the `mcap` library's. The walk through a file is our own because no
package recovers damaged MCAP files: the library stops at the first invalid record, and cannot read
a log after its recorder was killed, with damaged chunks, or with a missing or wrong summary.

An undamaged log takes the same walk, because only a walk shows that it is undamaged, and a second
reader would be more code. The library is faster with a log of images: it opens one of 8 MB 1 ms
faster, and reads it in two thirds of the time. But it makes an object of each message: a log of
200,000 messages takes 10 times as long to open, and 8 times as long to read.

- ``records``: bytes by position, records, chunks and the summary
- ``scan``: the walk from record to record, across damage
- ``file``: the contents of a log, and its damage
"""
