"""Lines of tables, and facts, as a replay writes them."""

from roadeval.results.facts import DriveFacts, Facts, FrameAccount
from roadeval.results.rows import Key, csv_lines, frame_rows, sum_rows

KEY = Key("street", "/camera/image")


def lines(result):
    return csv_lines(KEY, frame_rows(result))


def sum_lines(board):
    return csv_lines(KEY, sum_rows(board))


def facts_of(**parts):
    """Facts of a drive with these parts."""
    return Facts(
        **{"verdict": "", "drive": DriveFacts("street"), "frames": FrameAccount(), "totals": {}}
        | parts
    )
