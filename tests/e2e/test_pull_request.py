"""The action of GitHub as its shell script, against a server that plays GitHub's API."""

import json
import os
import re
import shutil
import subprocess
import sys
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path
from threading import Thread

import pytest
import yaml

from tests.e2e.commands import DEMO, ROADEVAL, here

ROOT = Path(__file__).resolve().parents[2]
SCRIPT, ACTION = ROOT / ".github" / "check.sh", ROOT / "action.yml"
LIMIT = "post.filtered.ERR > +0.5pp"
MARK = "<!-- roadeval: roadeval -->"
PERSON = {"id": 1, "user": {"type": "User"}, "body": f"ha\n{MARK}"}
BOT = {"type": "Bot"}


class Site:
    """GitHub's or GitLab's API with the comments of one pull request."""

    def __init__(self):
        self.comments = [dict(PERSON)] + [{"id": n, "user": BOT, "body": ""} for n in range(2, 120)]
        self.calls: list[tuple[str, str]] = []
        self.status = 200
        site = self

        class Handler(BaseHTTPRequestHandler):
            def answer(self):
                size = int(self.headers.get("Content-Length") or 0)
                body = json.loads(self.rfile.read(size) or "{}")
                path, _, query = self.path.partition("?")
                page = dict(p.split("=") for p in query.split("&") if p).get("page")
                done = site.comments[100 * (int(page) - 1) :][:100] if page else body
                if self.command != "GET" and site.status == 200:
                    site.calls.append((self.command, path))
                    comment = {
                        "id": int(path.rpartition("/")[2]) if self.command != "POST" else 999
                    }
                    kept = [c for c in site.comments if c["id"] != comment["id"]]
                    site.comments = [*kept, {**comment, "user": BOT, **body}]
                status = 200 if self.command == "GET" else site.status
                content = json.dumps(done).encode()
                self.send_response(status)
                self.send_header("Content-Length", str(len(content)))
                self.end_headers()
                self.wfile.write(content)

            do_GET = do_POST = do_PATCH = do_PUT = answer  # noqa: N815

            def log_message(self, *_):
                pass

        self.server = HTTPServer(("127.0.0.1", 0), Handler)
        Thread(target=self.server.serve_forever, daemon=True).start()
        self.address = f"http://127.0.0.1:{self.server.server_port}"

    @property
    def ours(self):
        return [c["body"] for c in self.comments if c["id"] == 999]


@pytest.fixture
def site():
    site = Site()
    yield site
    site.server.shutdown()


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """A good and a bad result of the demo's first frames."""
    folder = tmp_path_factory.mktemp("results")
    (folder / "bad.toml").write_text('[svm]\nkernel = "linear"\n[post]\nfill = false\n')
    short = ("--max-frames", 30, "--every", 1, "--record", "none", "-q")
    for name, words in (("good", ()), ("bad", ("--config", folder / "bad.toml"))):
        run = here("replay", DEMO, *short, *words, "--reports", folder / name)
        assert run.returncode == 0, run.stderr
    return folder


@pytest.fixture
def check(site, results, tmp_path):
    """Run the script in a repository as a step of the action does; replays are taken from above."""
    bin_ = tmp_path / "bin"
    bin_.mkdir()
    (bin_ / "roadeval").write_text(f"""#!/bin/sh
[ "$1" != compare ] || [ -e "$2" ] || [ "${{2#*://}}" != "$2" ] || exec "{ROADEVAL}" "$@"
echo "$*" >> "{tmp_path}/commands"
[ -d "{results}/$RESULT" ] || {{ echo "error: $RESULT @octocat" >&2; exit 1; }}
[ "$1" = compare ] || exec cp -R "{results}/$RESULT" .roadeval/new
done="{results}/compared $RESULT"
if [ ! -d "$done" ]; then # once for each result: the base is always the good one
  mkdir "$done"
  "{ROADEVAL}" "$@" || echo $? > "$done/code"
  cp .roadeval/*.[mhsx]* "$done"
fi
cp "$done"/*.* .roadeval
exit "$(cat "$done/code" 2> /dev/null || echo 0)"
""")
    (bin_ / "roadeval").chmod(0o755)
    (bin_ / "python3").symlink_to(sys.executable)
    repository = tmp_path / "repository"
    repository.mkdir()

    def run(result, event, **more):
        (tmp_path / "event.json").write_text(json.dumps(event))
        (tmp_path / "summary.md").write_text("")
        inputs = {
            "drives": "demo.mcap",
            "fail-if": LIMIT,
            "name": "roadeval",
            "token": "t",
            "args": "",
        }
        push = "pull_request" not in event
        environment = {
            "PATH": f"{bin_}:{os.environ['PATH']}",
            **{name: inputs.get(key, "") for name, key in names_of_inputs().items()},
            "KEEP": "1" if push else "",
            "RESULT": result,
            "GITHUB_EVENT_PATH": tmp_path / "event.json",
            "GITHUB_STEP_SUMMARY": tmp_path / "summary.md",
            "GITHUB_API_URL": site.address,
            "GITHUB_SERVER_URL": "https://github.example",
            "GITHUB_REPOSITORY": "team/road",
            "GITHUB_RUN_ID": "7",
            **more,
        }
        done = subprocess.run(
            ["sh", SCRIPT],
            cwd=repository,
            capture_output=True,
            text=True,
            check=False,
            env={name: str(value) for name, value in environment.items()},
            timeout=60,
        )
        done.summary = (tmp_path / "summary.md").read_text()
        return done

    run.repository, run.commands = repository, tmp_path / "commands"
    return run


def names_of_inputs():
    """The variables that the action's step sets, by the inputs that they hold."""
    (step,) = (s for s in steps() if "check.sh" in s.get("run", ""))
    found = ((n, re.fullmatch(r"\$\{\{ inputs\.([\w-]+) \}\}", v)) for n, v in step["env"].items())
    return {name: match[1] for name, match in found if match}


def steps():
    return yaml.safe_load(ACTION.read_text())["runs"]["steps"]


PULL = {"pull_request": {"number": 5}}


@pytest.mark.sweep
def test_a_repository_has_a_baseline_then_one_comment_that_each_push_updates(check, site):
    first = check("good", {"ref": "refs/heads/main"})
    assert first.returncode == 0, first.stderr
    assert first.summary.startswith("## roadeval: passed, there is no baseline yet")
    assert site.calls == []
    base = check.repository / ".roadeval" / "base"
    kept = (base / "summary.json").stat().st_mtime_ns
    codes = [check(result, PULL).returncode for result in ("good", "good", "bad", "good", "bad")]
    assert codes == [0, 0, 4, 0, 4]
    path = "/repos/team/road/issues"
    update = ("PATCH", f"{path}/comments/999")
    assert site.calls == [("POST", f"{path}/5/comments"), *[update] * 4]
    (comment,) = site.ours
    title, *_ = comment.splitlines()
    assert re.fullmatch(
        rf"## roadeval: failed, 1 of 1 limits exceeded: {re.escape(LIMIT)}; .*", title
    )
    assert "https://github.example/team/road/actions/runs/7" in comment
    assert comment.endswith(f"{MARK}\n")
    assert PERSON in site.comments
    made = {path.name for path in (check.repository / ".roadeval").glob("*.*")}
    assert made == {"comment.md", "compare.html", "badge.svg", "junit.xml", "errors.txt"}
    assert (base / "summary.json").stat().st_mtime_ns == kept


@pytest.mark.sweep
def test_a_push_that_fails_is_no_baseline(check):
    check("good", {})
    before = (check.repository / ".roadeval" / "base" / "frames.csv").read_bytes()
    assert check("bad", {}).returncode == 4
    assert (check.repository / ".roadeval" / "base" / "frames.csv").read_bytes() == before


@pytest.mark.parametrize("baseline", ["", "runs"])
def test_a_wrong_condition_is_told_before_the_replay_whether_there_is_a_baseline(
    baseline, check, site
):
    (check.repository / "runs").mkdir()
    limits = f"{LIMIT}\npost.filtered.ERR >> much"
    done = check("good", PULL, FAIL_IF=limits, BASELINE=baseline)
    assert done.returncode == 2
    assert not check.commands.exists()
    assert "much" in done.stderr
    assert site.ours[0].startswith("## roadeval: failed, a condition is wrong\n\n    ")


def test_an_empty_folder_is_no_baseline_yet_and_has_its_first_run_then(check):
    runs = check.repository / "runs"
    runs.mkdir()
    (runs / ".gitkeep").touch()
    done = check("good", {}, BASELINE="runs")
    assert done.returncode == 0, done.stderr
    assert done.summary == "## roadeval: passed, there is no baseline yet\n"
    assert len([*runs.glob("*/summary.json")]) == 1


def test_a_baseline_at_a_url_is_compared_with_and_not_replaced(check):
    check("good", {})
    assert check("good", {}).returncode == 0
    before = sorted(check.repository.iterdir())
    url = "https://example.org/base.zip"
    assert check("good", {}, BASELINE=url).returncode == 0
    assert check.commands.read_text().splitlines()[-1].startswith(f"compare {url} .roadeval/new ")
    assert sorted(check.repository.iterdir()) == before


@pytest.mark.sweep
def test_a_folder_of_runs_as_baseline_has_one_run_more(check, results):
    shutil.copytree(results / "good", check.repository / "runs" / "1")
    assert check("good", {}, BASELINE="runs").returncode == 0
    assert len([*check.repository.glob("runs/*/summary.json")]) == 2


@pytest.mark.sweep
def test_a_token_of_a_fork_leaves_the_summary_and_one_line(check, site):
    site.status = 403
    done = check("good", PULL)
    assert done.returncode == 0
    assert done.summary
    assert done.stdout.count("as on a pull request from a fork") == 1


def test_a_replay_that_fails_is_told_in_code_and_ends_the_check(check, site):
    done = check("@octocat\n</details>", PULL, GITHUB_ACTIONS="true")
    assert done.returncode == 1
    assert re.match(r"::stop-commands::[0-9a-f]{32}\n", done.stdout)
    (comment,) = site.ours
    assert comment.startswith(
        "## roadeval: failed, the replay ended with exit code 1\n\n    error: @"
    )
    assert "\n    </details> @octocat" in comment


def test_hostile_inputs_stay_words(check, site):
    name, drive = "$(touch pwned)`touch pwned` --> @octocat", "$(touch pwned) ;touch pwned.mcap"
    done = check("good", PULL, DRIVES=drive, ARGS="--labelled $(touch *", NAME=name)
    assert done.returncode == 0, done.stderr
    assert not [*check.repository.glob("pwned*")]
    words = "replay --record none --reports .roadeval/new --labelled $(touch * --"
    assert check.commands.read_text() == f"{words} {drive}\n"
    assert site.ours[0].endswith("<!-- roadeval: --touch-pwned--touch-pwned-------octocat -->\n")


@pytest.mark.sweep
def test_gitlab_has_a_note_on_the_merge_request(check, site):
    about = {"CI_API_V4_URL": site.address, "CI_PROJECT_ID": 3, "CI_MERGE_REQUEST_IID": 8}
    done = check("good", PULL, GITHUB_EVENT_PATH="", CI_JOB_URL="https://lab.example/1", **about)
    assert done.returncode == 0
    assert site.calls == [("POST", "/projects/3/merge_requests/8/notes")]


@pytest.mark.sweep
def test_a_folder_of_drives_is_a_fleet(check):
    check("good", PULL, DRIVES="drives/")
    words = "fleet --record none --output .roadeval/new -- drives/\n"
    assert check.commands.read_text() == words


def test_the_action_keeps_expressions_out_of_shells_and_pins_what_it_uses():
    for step in steps():
        assert "${{" not in step.get("run", "")
        assert re.search(r"@[0-9a-f]{40}$", step.get("uses", f"@{'0' * 40}"))
    assert {*names_of_inputs()} == {"DRIVES", "ARGS", "FAIL_IF", "NAME", "TOKEN"}
    save, restore = (s["with"] for s in steps() if "actions/cache" in s.get("uses", ""))
    assert save["path"] == restore["path"]
