"""``roadeval serve`` while a test runs."""

import signal
import subprocess
import urllib.error
import urllib.request
from contextlib import contextmanager

from tests.e2e.commands import ROADEVAL


@contextmanager
def serving(*words):
    """Run the command until the block ends; yields its address and its process."""
    command = [str(word) for word in (ROADEVAL, "serve", *words)]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as run:
        try:
            yield run.stdout.readline().strip(), run
        finally:
            run.send_signal(signal.SIGINT)
            run.wait(60)


def status(address, *, method="GET", **headers):
    """The status of an answer, asked for as no browser would."""
    asked = urllib.request.Request(address, method=method, headers=headers)
    try:
        with urllib.request.urlopen(asked, timeout=60) as answer:
            return answer.status
    except urllib.error.HTTPError as error:
        return error.code
