"""The rows that are read by their place in the file are those of Rerun's own reader."""

from collections import defaultdict
from pathlib import Path
from typing import Any

from rerun.chunk import RrdReader

from roadeval import Recording
from roadeval.recording.layout import FRAME
from roadeval.recording.rrd_file import RrdFile


def rows_by_rerun(path: Path) -> dict[tuple[str, str, bool], list[tuple[int | None, Any]]]:
    """The rows with a value, by entity, component and whether they were logged once."""
    rows = defaultdict(list)
    for chunk in RrdReader(path).stream():
        batch = chunk.to_record_batch()
        is_static = FRAME not in batch.schema.names
        frames = [None] * batch.num_rows if is_static else batch.column(FRAME).to_pylist()
        for name in batch.schema.names:
            if (batch.schema.field(name).metadata or {}).get(b"rerun:kind") == b"data":
                key = chunk.entity_path, name, is_static
                rows[key] += zip(frames, batch.column(name).to_pylist(), strict=True)
    return {key: [row for row in values if row[1]] for key, values in rows.items()}


def test_every_row_is_the_one_that_reruns_reader_gives(recording: Recording) -> None:
    file, by_rerun = RrdFile(recording.path), rows_by_rerun(recording.path)
    assert len({path for path, *_ in by_rerun}) > 20
    for (path, component, is_static), expected in by_rerun.items():
        rows: list[tuple[int | None, Any]] = []
        for batch in file.batches(path, component, static=is_static):
            frames = [None] * batch.num_rows if is_static else batch.column(FRAME).to_pylist()
            rows += zip(frames, batch.column(component).to_pylist(), strict=True)
        assert sorted(rows, key=str) == sorted(expected, key=str), (path, component)


def test_every_image_is_the_one_that_reruns_reader_gives(recording: Recording) -> None:
    file, images = RrdFile(recording.path), 0
    for (path, component, _), rows in rows_by_rerun(recording.path).items():
        if component == "EncodedImage:blob":
            for frame, (blob,) in rows:
                assert frame is not None
                assert file.image(path, component, frame) == bytes(blob)
                images += 1
    assert images >= len(recording.frame_numbers)
