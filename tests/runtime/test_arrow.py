"""Arrow that does not look for pandas, and still works with it where it is asked to."""

import subprocess
import sys
from textwrap import dedent

LEFT_OUT = "import sys; from roadeval.runtime.arrow import leave_out_pandas; leave_out_pandas()\n"


def told(code: str, before: str = "") -> str:
    """Return what a process of its own prints that leaves pandas out."""
    words = [sys.executable, "-c", before + LEFT_OUT + dedent(code)]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


def test_arrays_lists_and_recordings_import_no_pandas(tmp_path):
    found = told(
        f"""
        import numpy as np, pyarrow as pa, rerun as rr
        pa.array(np.arange(3)), pa.array(["a", None]), pa.scalar(1.5), pa.table({{"a": [1]}})
        recording = rr.RecordingStream("test")
        recording.save({str(tmp_path / "a.rrd")!r})
        recording.log("a", rr.Scalars(1.0))
        recording.log("b", rr.AnyValues(c="d", e=2))
        print("pandas" in sys.modules)
        """
    )
    assert found == "False"


def test_pandas_itself_is_imported_and_converts_both_ways(tmp_path):
    found = told(
        f"""
        import pandas as pd, pyarrow as pa
        frame = pd.DataFrame({{"a": [1.5, None], "b": ["x", None]}})
        frame.to_parquet({str(tmp_path / "a.parquet")!r})
        print(pd.read_parquet({str(tmp_path / "a.parquet")!r}).equals(frame))
        print(pa.Table.from_pandas(frame).to_pandas().equals(frame))
        """
    )
    assert found.split() == ["True", "True"]


def test_pandas_that_is_there_already_is_found():
    found = told(
        """
        import pyarrow as pa
        print(pa.array(pd.Series([1.0, float("nan")])).null_count)
        """,
        before="import pandas as pd; ",
    )
    assert found == "1"
