"""Lines of tables, and facts, as a replay writes them."""

from roadeval.data import TruthClass
from roadeval.evaluation.score.conditions import QUANTITIES
from roadeval.results.facts import DriveFacts, Facts, FrameAccount
from roadeval.results.rows import Key, condition_rows, csv_lines, frame_rows, sum_rows
from roadeval.results.schema import TABLES
from roadeval.results.tables import read_table

KEY = Key("street", "/camera/image")


def lines(result):
    conditions = condition_rows(result, [0.5] * len(QUANTITIES))
    return csv_lines(KEY, frame_rows(result) | conditions)


CLASSES = [
    TruthClass(3, "road", "road"),
    TruthClass(4, "", "other"),
    TruthClass(8, 'a, "b"', "other"),
]


def sum_lines(board, windows):
    return csv_lines(KEY, sum_rows(board, windows, CLASSES))


def frames_of(results):
    """The table ``frames`` that the lines of results read back as."""
    text = "".join(lines(result)["frames"] for result in results)
    return read_table("frames", TABLES["frames"].header + text)


def facts_of(**parts):
    """Facts of a drive with these parts."""
    return Facts(
        **{"verdict": "", "drive": DriveFacts("street"), "frames": FrameAccount(), "totals": {}}
        | parts
    )
