"""Findings made by hand, and reading back what was typeset."""

import io
import math
import re
from dataclasses import fields, replace
from functools import cached_property

from pypdf import PdfReader

from roadeval.evaluation.stats.difference import Difference
from roadeval.report.blocks import Cell, Details, Report
from roadeval.report.findings import Findings
from roadeval.results.facts import DriveFacts, Facts, FrameAccount


def a_document(*blocks, title="street"):
    """A document of some blocks."""
    return Report(title, "subtitle", blocks, "kicker", "footer")


def reader(content):
    """Open a PDF."""
    return PdfReader(io.BytesIO(content))


def text(content):
    """Every word of a PDF, with single spaces between them."""
    pages = (page.extract_text() for page in reader(content).pages)
    return re.sub(r"\s+", " ", " ".join(pages))


VARIANTS = ("filtered", "unfiltered", "blind")


def rates(err, fpr=0.25, fnr=0.5, **more):
    """The rates of a mask, with those that mirror them."""
    mirrored = {"ACC": 1 - err, "TNR": 1 - fpr, "TPR": 1 - fnr}
    return {"ERR": err, "FPR": fpr, "FNR": fnr} | mirrored | more


def a_total(err, fpr=0.25, fnr=0.5, tp=6):
    """Rates of a mask over a drive of 1,200 frames, and what it counts of 20 pixels."""
    counts = {"TP": tp, "TN": 16 - tp, "FP": 3, "FN": 1}
    pooled = {"ERR": err + 0.01, "FPR": 0.25, "TPR": 0.83, "precision": tp / (tp + 3)}
    pooled = {f"pooled_{name}": rate for name, rate in pooled.items()}
    return rates(err, fpr, fnr, frames=1200, undefined={}, **counts, **pooled)


def a_difference(mean, low=None, high=None):
    """A paired difference."""
    p = None if low is None else 0.003
    known = {"effective": 40.0, "p_holm": p and 0.01, "comparisons": p and 3}
    needed = 2000 if low is None else None
    units, mean = (0, math.nan) if mean is None else (1200, mean)
    return Difference(mean, low, high, p, 0.95, "frames", units, needed=needed, **known)


def by_rate(better=0, worse=0, err=None):
    """What changed in each rate, on so many frames."""
    found = replace(a_difference(-0.02, -0.03, -0.01), better=better, worse=worse)
    return dict.fromkeys(("ERR", "FPR", "FNR"), found) | ({"ERR": err} if err else {})


FIELDS = {each.name for each in fields(Findings)}
COMPUTED = {name for name, each in vars(Findings).items() if isinstance(each, cached_property)}
FACTS = {each.name for each in fields(Facts)} - FIELDS - COMPUTED


def some_findings(**changes):
    """Findings of a drive whose numbers all differ: of two variants and the baseline.

    Changes are of the findings, of what they compute, or of their facts, by name.
    """
    totals = {
        "filtered": {"svm": a_total(0.20, 0.21, 0.22), "post": a_total(0.10, 0.11, 0.12)},
        "unfiltered": {"svm": a_total(0.30, 0.31, 0.32), "post": a_total(0.15, 0.16, 0.17, tp=12)},
        "blind": {"post": a_total(0.12, 0.13, 0.14)},
    }
    facts = {
        "verdict": "It helps.",
        "drive": DriveFacts("street", width=40, height=20),
        "frames": FrameAccount(1210, evaluated=1200, skipped={"trained on": 10}),
        "totals": totals,
    }
    made = Findings(
        "drive.rrd",
        Facts(**facts | {n: value for n, value in changes.items() if n in FACTS}),
        again="repeat street.mcap",
        inspect="open frame {}".format,
        pictured=1200,
    )
    made = replace(made, **{n: value for n, value in changes.items() if n in FIELDS})
    vars(made).update({n: value for n, value in changes.items() if n in COMPUTED})
    return made


def the(kind, blocks):
    """The only block of a kind."""
    (block,) = (block for block in blocks if isinstance(block, kind))
    return block


def opened(blocks):
    """Blocks, with those that a page shows after a click in the place of their title."""
    return [inner for b in blocks for inner in (opened(b.blocks) if type(b) is Details else [b])]


def plain_rows(table):
    """A table's cells as text."""
    return [[cell.text if isinstance(cell, Cell) else cell for cell in row] for row in table.rows]


def column(table, title):
    """The cells below a title."""
    place = list(table.columns).index(title)
    return [row[place] for row in table.rows]
