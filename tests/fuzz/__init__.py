"""Damaged input of every kind, made at random: what is promised, and whether it holds.

A harness is a function of bytes that may end only in a `RoadevalError`, and within limits. See
`tests.fuzz.harness`; to look for longer than the tests do::

    python -m tests.fuzz --seconds 60                      # all harnesses, ten seconds each
    python -m tests.fuzz damage --seconds 3600 --jobs 2    # one, for an hour, in two processes
"""
