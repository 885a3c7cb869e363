"""The record of a drive: written and read back as it was."""

from roadeval.results.fleet.record import Record, cells, read_record
from roadeval.results.fleet.schema import RECORDED


def test_a_file_s_name_that_is_no_text_comes_back(tmp_path):
    rows = {name: [] for name in RECORDED} | {"drives": cells("drives", [{"drive": "a"}])}
    made = Record("a", "asked", {"caf\udce9.mcap": [1, 2]}, rows)
    (tmp_path / "records").mkdir()
    made.write(tmp_path)
    read = read_record(tmp_path, "a")
    assert read is not None
    assert read.stamp == made.stamp
