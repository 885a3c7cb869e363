#!/bin/sh
# Replay drives, compare with the last good result, and write one comment that later runs update.
# It runs on GitHub (action.yml), on GitLab, and in a shell, where it writes files alone.
#
#   DRIVES    a drive, or a folder or manifest of drives
#   ARGS      more options of replay or fleet, apart by spaces
#   FAIL_IF   conditions of compare, one a line; a wrong one ends the check before the replay
#   BASELINE  the last good result, its URL, or a folder of runs; .roadeval/base by default. None
#             yet, or an empty folder: passes
#   KEEP      1: a result that passed becomes the baseline, or one more run of the folder; one at a
#             URL stays
#   NAME      name of the check; each has its comment
#   TOKEN     token that writes the comment; without one there is none
#
# The exit code is that of compare. Everything is written to .roadeval/ before.
set -eu
base=${BASELINE:-.roadeval/base} new=.roadeval/new code=0
mkdir -p .roadeval
rm -rf "$new" .roadeval/comment.md .roadeval/compare.html .roadeval/badge.svg .roadeval/junit.xml

# What names in the output look like is no command of GitHub's.
[ -z "${GITHUB_ACTIONS:-}" ] ||
  echo "::stop-commands::$(od -An -N16 -tx1 /dev/urandom | tr -d ' \n')"

compare() {
  while IFS= read -r limit; do
    [ -z "$limit" ] || set -- "$@" --fail-if "$limit"
  done <<EOF
${FAIL_IF:-}
EOF
  roadeval compare "$@" 2> .roadeval/errors.txt
}

set -f # the options are split at spaces, and no more
if [ "${DRIVES%.mcap}" != "$DRIVES" ] || [ -f "$DRIVES/metadata.yaml" ]; then
  set -- replay --record none --reports "$new" ${ARGS:-} -- "$DRIVES"
else
  set -- fleet --record none --output "$new" ${ARGS:-} -- "$DRIVES"
fi

# Conditions are read before results. There is none yet: only exit code 2 says that one is wrong.
what="a condition is wrong"
[ -z "${FAIL_IF:-}" ] || compare "$new" || [ $? != 2 ] || code=2
if [ "$code" = 0 ]; then
  roadeval "$@" 2> .roadeval/errors.txt || code=$?
  what="the replay ended with exit code $code"
fi
cat .roadeval/errors.txt >&2

if [ "$code" = 0 ] || [ "$code" = 3 ]; then # 3: a part of a log was lost, and compare says which
  code=0
  if [ -n "$(ls -- "$base" 2> /dev/null)" ] || [ "${base#*://}" != "$base" ]; then
    set -- "$base" "$new" --markdown .roadeval/comment.md --junit .roadeval/junit.xml
    compare "$@" -o .roadeval/compare.html -o .roadeval/badge.svg || code=$?
    cat .roadeval/errors.txt >&2
    what="the comparison ended with exit code $code"
  else
    echo "## roadeval: passed, there is no baseline yet" > .roadeval/comment.md
  fi
fi
# Names in errors are from logs: in a block of code they do nothing.
[ -e .roadeval/comment.md ] || {
  printf '## roadeval: failed, %s\n\n' "$what"
  tail -n 20 .roadeval/errors.txt | cut -c 1-1000 | sed 's/^/    /'
} > .roadeval/comment.md
if [ "$code" = 0 ] && [ "${KEEP:-}" = 1 ] && [ "${base#*://}" = "$base" ]; then
  # A folder of runs has one more.
  [ ! -d "$base" ] || [ -e "$base/summary.json" ] || [ -e "$base/fleet.json" ] ||
    base=$base/$(date +%s)
  rm -rf "$base"
  cp -R "$new" "$base"
fi

[ -z "${GITHUB_STEP_SUMMARY:-}" ] || cat .roadeval/comment.md >> "$GITHUB_STEP_SUMMARY"
python=$(command -v python3 || command -v python)
"$python" - <<'EOF' || echo "roadeval: the comment was not written" >&2
import json, os, re, sys, urllib.error, urllib.request
from pathlib import Path

get = os.environ.get
token, name = get("TOKEN"), re.sub(r"[^\w.-]", "-", get("NAME") or "roadeval")
if path := get("GITHUB_EVENT_PATH"):
    number = (json.loads(Path(path).read_bytes()).get("pull_request") or {}).get("number")
    repository = get("GITHUB_REPOSITORY")
    note = f"{get('GITHUB_API_URL')}/repos/{repository}/issues/comments"
    notes = f"{get('GITHUB_API_URL')}/repos/{repository}/issues/{number}/comments"
    run = f"{get('GITHUB_SERVER_URL')}/{repository}/actions/runs/{get('GITHUB_RUN_ID')}"
    update, header = "PATCH", {"Authorization": f"Bearer {token}"}
else:
    number, run = get("CI_MERGE_REQUEST_IID"), get("CI_JOB_URL")
    project = f"{get('CI_API_V4_URL')}/projects/{get('CI_PROJECT_ID')}"
    notes = note = f"{project}/merge_requests/{number}/notes"
    update, header = "PUT", {"PRIVATE-TOKEN": token}
if not (token and number):
    sys.exit()


def call(method, url, text=None):
    content = text and json.dumps({"body": text}).encode()
    headers = {**header, "Content-Type": "application/json"}
    request = urllib.request.Request(url, content, headers, method=method)
    with urllib.request.urlopen(request, timeout=30) as answer:
        return json.load(answer)


marker = f"<!-- roadeval: {name} -->"
text = Path(".roadeval/comment.md").read_text(encoding="utf-8")
text += f"\n[The run, and its files]({run})\n\n{marker}\n"
try:
    page, mine = 1, None
    while not mine and (there := call("GET", f"{notes}?per_page=100&page={page}")):
        # On GitHub no person's comment is overwritten, whatever stands in it.
        ours = [c for c in there if c.get("user", {}).get("type", "Bot") == "Bot"]
        mine = next((c["id"] for c in ours if c["body"].rstrip().endswith(marker)), None)
        page += 1
    call(update, f"{note}/{mine}", text) if mine else call("POST", notes, text)
except urllib.error.HTTPError as error:
    if error.code not in (401, 403, 404):
        raise
    print("roadeval: this token writes no comment, as on a pull request from a fork: see the summary")
EOF
exit "$code"
