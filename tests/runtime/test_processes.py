"""What a process of its own computes is what this one would, and it is gone afterwards."""

import os
import subprocess
import sys

import numpy as np
import pytest
from sklearn.svm import SVC, LinearSVC

from roadeval.pipeline import solvers
from roadeval.runtime import processes as apart
from tests.jobs.making import write_log

RNG = np.random.default_rng(0)
FEATURES = RNG.normal(0, 1, (200, 3))
ROAD = FEATURES @ [1, 2, 3] + RNG.normal(0, 1, 200) > 0
DUAL = {"features": FEATURES, "road": ROAD, "c": 1.5, "kernel": "rbf", "gamma": 0.5}
PRIMAL = {"features": FEATURES.astype(np.float32), "road": ROAD, "c": 0.01}


@pytest.fixture
def started(monkeypatch):
    """The processes that were started; as if this one had not imported the library."""
    processes, start = [], apart.start

    def kept(module):
        processes.append(start(module))
        return processes[-1]

    monkeypatch.setattr(apart, "start", kept)
    monkeypatch.setattr(solvers, "LIBRARY", "a library that is not imported")
    return processes


def assert_equal(found, twin):
    assert found.keys() == twin.keys()
    for name, array in twin.items():
        assert np.asarray(array).dtype == found[name].dtype, name
        np.testing.assert_array_equal(found[name], array, err_msg=name)


@pytest.mark.parametrize(
    ("function", "given"),
    [
        (solvers.support_vectors, DUAL),
        (solvers.support_vectors, DUAL | {"kernel": "linear"}),
        (solvers.hyperplane, PRIMAL),
    ],
    ids=["dual, rbf", "dual, linear", "primal"],
)
def test_the_answer_is_the_same_elsewhere(started, function, given):
    here = apart.call(function, **given)
    assert not started
    with apart.elsewhere(solvers):
        assert_equal(apart.call(function, **given), here)
        (process,) = started
        assert process.poll() is None
        assert_equal(apart.call(function, **given), here)
    assert len(started) == 1
    assert process.returncode is not None
    assert not apart._HELPERS.get({})
    assert_equal(apart.call(function, **given), here)


def test_the_solutions_are_scikit_learns():
    dual = SVC(C=1.5, kernel="rbf", gamma=0.5).fit(FEATURES, ROAD)
    found = solvers.support_vectors(**DUAL)
    np.testing.assert_array_equal(found["vectors"], FEATURES[dual.support_])
    np.testing.assert_array_equal(found["weights"], dual.dual_coef_[0])
    assert found["offset"] == dual.intercept_[0]
    primal = LinearSVC(C=0.01, dual=False).fit(FEATURES.astype(np.float32), ROAD)
    found = solvers.hyperplane(**PRIMAL)
    np.testing.assert_array_equal(found["weights"], primal.coef_[0])
    assert found["offset"] == primal.intercept_[0]
    assert found["weights"].dtype == found["offset"].dtype == np.float64


def test_a_library_that_is_here_is_used_here(monkeypatch):
    monkeypatch.setattr(apart, "start", pytest.fail)
    with apart.elsewhere(solvers):
        assert_equal(apart.call(solvers.hyperplane, **PRIMAL), solvers.hyperplane(**PRIMAL))


@pytest.mark.parametrize("executable", ["", None, "/no/such/python", "/bin/cat"])
def test_it_is_computed_here_where_no_process_can_be_started(started, monkeypatch, executable):
    monkeypatch.setattr(sys, "executable", executable)
    with apart.elsewhere(solvers):
        assert_equal(apart.call(solvers.hyperplane, **PRIMAL), solvers.hyperplane(**PRIMAL))
    assert not started


def test_no_process_is_started_from_a_program_that_python_is_built_into(monkeypatch):
    monkeypatch.setattr(sys, "frozen", True, raising=False)
    with pytest.raises(OSError, match="no Python"):
        apart.start(solvers.__name__)


def test_no_process_is_started_that_would_import_from_elsewhere(monkeypatch, tmp_path):
    monkeypatch.syspath_prepend(tmp_path / f"one{os.pathsep}two")
    with pytest.raises(OSError, match="cannot be named"):
        apart.start(solvers.__name__)


def test_it_is_computed_here_once_the_process_is_gone(started):
    with apart.elsewhere(solvers):
        started[0].kill()
        # Gone, but nobody has asked yet.
        os.waitid(os.P_PID, started[0].pid, os.WEXITED | os.WNOWAIT)
        for _ in range(2):
            assert_equal(apart.call(solvers.hyperplane, **PRIMAL), solvers.hyperplane(**PRIMAL))


@pytest.mark.parametrize(
    "saying",
    [
        "print('welcome', flush=True)",
        "import os; os.write(1, bytes(7) + b'9PK'); os._exit(0)",
        "import os; os.write(1, bytes(7) + bytes([5]) + b'hello')",
    ],
    ids=["a line at every start of Python", "half an answer", "no answer"],
)
def test_a_process_that_says_something_else_is_not_listened_to(
    started, monkeypatch, tmp_path, saying
):
    (tmp_path / "sitecustomize.py").write_text(saying)
    monkeypatch.syspath_prepend(tmp_path)
    with apart.elsewhere(solvers):
        for _ in range(2):
            assert_equal(apart.call(solvers.hyperplane, **PRIMAL), solvers.hyperplane(**PRIMAL))
            assert started[0].returncode is not None


def test_whoever_waits_can_be_interrupted_and_nothing_is_left(started, monkeypatch):
    """As by a signal whose handler raises an error that pipes know, too."""

    def interrupted(_pipe):
        raise TimeoutError

    with apart.elsewhere(solvers):
        with monkeypatch.context() as patched:
            patched.setattr(apart, "_receive", interrupted)
            with pytest.raises(TimeoutError):
                apart.call(solvers.hyperplane, **PRIMAL)
        assert started[0].returncode is not None
        assert_equal(apart.call(solvers.hyperplane, **PRIMAL), solvers.hyperplane(**PRIMAL))


def test_arguments_without_a_name_are_not_lost(started):
    with apart.elsewhere(solvers):
        assert_equal(apart.call(solvers.hyperplane, *PRIMAL.values()), solvers.hyperplane(**PRIMAL))
        assert started[0].poll() is None


def test_what_goes_wrong_elsewhere_goes_wrong_here(started, capfd):
    with (
        apart.elsewhere(solvers),
        pytest.raises(ValueError, match="classes has to be greater than one"),
    ):
        apart.call(solvers.support_vectors, **DUAL | {"road": np.ones(200, bool)})
    assert started
    assert capfd.readouterr() == ("", "")


@pytest.mark.skipif(sys.platform == "win32", reason="sessions are POSIX")
def test_a_ctrl_c_at_the_terminal_is_not_for_it():
    process = apart.start(solvers.__name__)
    assert os.getsid(process.pid) != os.getsid(0)
    process.communicate()


def test_the_process_imports_from_where_this_one_does(tmp_path, monkeypatch):
    """A file of the working folder is not taken for a library."""
    (tmp_path / "numpy.py").write_text("raise SystemExit('the wrong NumPy')")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [place for place in sys.path if place])
    process = apart.start(solvers.__name__)
    assert process.communicate() == (b"", None)
    assert process.returncode == 0


def test_a_run_has_no_use_for_the_library_itself(tmp_path):
    drive = write_log(tmp_path / "drive.mcap")
    program = f"""
import sys

import roadeval, roadeval.jobs.replay

sys.modules["roadeval.jobs.replay"].write_figures = lambda *given: []
drive, save, reports = {[str(drive), str(tmp_path / "out.rrd"), str(tmp_path)]}
outcome = roadeval.replay(drive, save=save, reports=reports)
assert outcome.summary["training"]["frames"]
roadeval.train([drive], reports + "/drive.model")
assert "sklearn" not in sys.modules
"""
    subprocess.run([sys.executable, "-c", program], check=True)
