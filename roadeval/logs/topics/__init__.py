"""The topics of a log: their messages, calibrations, and the choice of topics to replay."""
