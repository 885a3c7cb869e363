"""The setting ``output.record``."""

import subprocess
import sys

import pytest

from roadeval.recording import RecordingError, RecordRule


@pytest.mark.parametrize("text", ["all", "masks", "none", "worst:1", "every:10", "worst:99999999"])
def test_a_rule_is_its_kind_and_number(text):
    rule = RecordRule.parse(text)
    kind, _, number = text.partition(":")
    assert (rule.kind, rule.number) == (kind, int(number or 0))


@pytest.mark.parametrize(
    "text",
    ["", "some", "worst", "worst:0", "worst:-1", "worst:1.5", "worst:\u0661", "all:3", "ALL"],
)
def test_another_text_is_refused_with_the_settings_name(text):
    with pytest.raises(RecordingError) as caught:
        RecordRule.parse(text)
    assert str(caught.value) == (
        f"`output.record` {text}: choose all, masks, worst:K, every:N or none (as worst:20)"
    )


def test_a_rule_is_checked_without_rerun():
    code = (
        "import sys; from roadeval.recording import RecordRule; RecordRule.parse('all'); "
        "sys.exit('rerun' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
