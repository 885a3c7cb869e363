"""Each harness for a second, with the same cases each time; and what finds the findings."""

import os
from itertools import count
from time import monotonic

import pytest

from roadeval import RoadevalError
from tests.fuzz import campaign, harness
from tests.fuzz.campaign import Job, case_of
from tests.fuzz.harness import NAMES, Harness, Lost, harness_of, run_case

SEED = 0


@pytest.mark.timeout(0)
@pytest.mark.filterwarnings("ignore::UserWarning")
@pytest.mark.parametrize("name", NAMES)
def test_no_case_breaks_a_promise(name, request):
    seconds = request.config.getoption("--fuzz-seconds", 0)
    end = monotonic() + seconds
    tried = harness_of(name)
    seeds = tried.seeds()
    for number in count():
        if monotonic() > end if seconds else number >= tried.quick:
            break
        outcome = run_case(tried, case_of(tried, seeds, SEED, number))
        assert not outcome.kind, f"case {number} of seed {SEED}: {outcome.kind}, {outcome.where}"


@pytest.mark.parametrize("name", NAMES)
def test_the_seeds_themselves_are_in_order(name):
    tried = harness_of(name)
    seeds = tried.seeds()
    if name == "results":  # a sound recording, a folder of sound files, a recording that ends early
        seeds = [*seeds[:2], seeds[-1]]
    for seed in seeds:
        assert run_case(tried, seed).kind == ""


def outcome_of(check):
    return run_case(Harness(check, lambda: [b""]), b"")


@pytest.mark.parametrize(
    ("error", "kind"),
    [
        (RoadevalError("no such drive"), ""),
        (KeyError("x"), "uncaught"),
        (BaseException("a panic"), "uncaught"),
        (Lost("frame 3"), "lost"),
        (AssertionError(), "uncaught"),
    ],
)
def test_an_error_that_is_not_known_is_a_finding(error, kind):
    def check(data):
        raise error

    assert outcome_of(check).kind == kind


def test_a_case_that_takes_long_or_much_is_one(monkeypatch):
    monkeypatch.setattr(harness, "SLOW", 0)
    assert outcome_of(lambda data: None).kind == "slow"
    monkeypatch.setattr(harness, "SLOW", 10)
    monkeypatch.setattr(harness, "BIG", 1 << 20)
    # So much is never taken from what an earlier case has given back. Where memory is short the
    # system may take pages back meanwhile.
    assert any(outcome_of(lambda data: bytearray(64 << 20)).kind == "big" for _ in range(3))


def test_what_a_library_writes_to_standard_error_is_one(capfd):
    found = outcome_of(lambda data: os.write(2, b"libpng error: bad\n"))
    assert (found.kind, found.where) == ("printed", "libpng error: bad")


def test_a_case_that_ends_its_process_is_kept_and_the_rest_is_tried(tmp_path, monkeypatch):
    """A worker that dies at its third case is started anew at the fourth."""
    fatal = case_of(Harness(print, list, random=True), [], SEED, 2)
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(tmp_path), str(campaign.ROOT)]))
    (tmp_path / "sitecustomize.py").write_text(
        "import os\n"
        "import tests.fuzz.harnesses.configurations as module\n"
        "from tests.fuzz.harness import Harness\n"
        f"check = lambda data: os._exit(7) if data == {fatal!r} else None\n"
        "module.HARNESS = Harness(check, list, random=True)\n"
    )
    result = campaign.run([Job("configurations", "", SEED, False, 4, 0)], tmp_path / "kept")
    assert result.cases == 4
    assert [(kind, times) for (kind, _, _), times in result.findings.items()] == [("died", 1)]
    (kept,) = (tmp_path / "kept").iterdir()
    assert kept.read_bytes() == fatal
