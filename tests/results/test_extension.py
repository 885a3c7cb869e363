"""One more file with a metric or a region is all that it takes."""

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
METRIC = '''
"""False discovery rate."""

from roadeval.evaluation.metric import Metric, ratio

FDR = Metric(
    name="FDR",
    title="false discovery rate",
    formula="FP / (TP + FP)",
    function=lambda counts: ratio(counts.fp, counts.tp + counts.fp),
    higher_is_better=False,
    order=30,
)
METRICS = (FDR,)
'''
REGION = '''
"""The leftmost columns."""

import numpy as np

from roadeval.data import pack
from roadeval.evaluation.region import Region


def left(labelled):
    height, width = labelled.truth.shape
    return {"left": pack(np.arange(width)[None].repeat(height, 0) < 2)}


REGIONS = (Region({"left": "on the left"}, order=25, find=left),)
'''
PROGRAM = """
import importlib.util
import sys
from pathlib import Path

import roadeval.evaluation

# What the folder holds is found as if it lay in the package.
folder = Path(sys.argv[1])
for kind in ("metrics", "regions"):
    name = f"roadeval.evaluation.{kind}"
    spec = importlib.util.find_spec(name)
    module = importlib.util.module_from_spec(spec)
    module.__path__.append(str(folder / kind))
    sys.modules[name] = module
    setattr(roadeval.evaluation, kind, module)
    spec.loader.exec_module(module)

from roadeval.data import Role
from roadeval.evaluation import regions, score
from roadeval.evaluation.score import Scoreboard
from roadeval.evaluation.settings import EvaluationSettings
from roadeval.results.folder import ResultsFolder, ResultsWriter
from roadeval.results.schema import TABLES, documentation
from tests.results.making import facts_of, lines, sum_lines
from tests.evaluation.making import a_frame, a_variant, pixels

board = Scoreboard(EvaluationSettings(bands=1), ["net"], None)
variant = a_variant("net", {"post": pixels("#.#.", "##..")})
result = board.score(a_frame(pixels("##..", "##.?")), Role.EVALUATED, (variant,))
board.add(result)
with ResultsWriter(folder / "out") as writer:
    writer.append(lines(result))
    writer.append(sum_lines(board))
    writer.finish(facts_of(**board.summary()), "")
read = ResultsFolder(folder / "out")
assert read.table("frames")["FDR"].tolist() == [0.25]
windows = read.table("windows")
assert windows["FDR"].tolist() == windows["pooled_FDR"].tolist() == [0.25]
assert read.facts.totals["net"]["post"]["pooled_FDR"] == 0.25
assert score.totals(read.rows("frames"))["net"]["post"]["FDR"] == 0.25
assert "FP / (TP + FP)" in documentation(TABLES, "csv")
left = read.table("regions").set_index("region").loc["left"]
assert left[["TP", "TN", "FP", "FN"]].tolist() == [3, 0, 0, 1]
assert regions.titles([*read.table("regions")["region"]])["left"] == "on the left"
"""


def test_a_metric_and_a_region_arrive_in_tables_totals_and_documentation(tmp_path: Path) -> None:
    for kind, text in (("metrics", METRIC), ("regions", REGION)):
        (tmp_path / kind).mkdir()
        (tmp_path / kind / "added.py").write_text(text)
    program = [sys.executable, "-c", PROGRAM, tmp_path]
    run = subprocess.run(program, cwd=ROOT, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
