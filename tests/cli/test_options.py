"""Which options a command takes."""

import pytest

from roadeval.cli.options import takes


@pytest.mark.parametrize("name", ["frames.keep_corrupt_", "label"])
def test_a_setting_that_no_option_sets_is_an_error(name):
    with pytest.raises(ValueError, match=f"no option sets {name}$"):
        takes("preset", name)
