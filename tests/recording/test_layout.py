"""What is known before the first frame."""

import subprocess
import sys

import pytest

from roadeval.data import RESERVED
from roadeval.recording.layout import Layout, RecordingError, RecordRule
from tests.recording.making import VARIANT, layout, paths_of


def test_a_layout_survives_its_json():
    whole = layout(first_frame=10, rate_hz=15.0, properties={"version": "1", "frames": 3})
    assert Layout.from_json(whole.to_json()) == whole


@pytest.mark.parametrize("name", [*sorted(RESERVED), "../x", "a b", "", "größe"])
def test_a_variant_cannot_take_a_name_that_the_recording_uses_or_cannot_hold(name):
    variant = type(VARIANT)(name, "", ("post",), VARIANT.layers)
    with pytest.raises(RecordingError, match=f"named '{name}'"):
        layout(variants=(variant,))


def test_every_path_that_is_no_variants_begins_with_a_reserved_name(recording):
    tops = {path.split("/")[1] for path in paths_of(recording.path)}
    assert tops - {"filtered", "__properties"} < RESERVED


@pytest.mark.parametrize("text", ["all", "masks", "none", "worst:1", "every:10", "worst:99999999"])
def test_a_rule_is_its_kind_and_number(text):
    rule = RecordRule.parse(text)
    kind, _, number = text.partition(":")
    assert (rule.kind, rule.number) == (kind, int(number or 0))


def test_a_rule_is_checked_without_rerun():
    code = (
        "import sys; from roadeval.recording.layout import RecordRule; RecordRule.parse('all'); "
        "sys.exit('rerun' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
