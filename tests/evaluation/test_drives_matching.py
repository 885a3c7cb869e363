"""Which drives of two fleets are the same."""

from roadeval.evaluation.drives_matching import FleetDrive, LeftOut, LeftOutBecause, match_drives


def scored(sha256="f"):
    return FleetDrive(sha256, scored=True)


def test_drives_of_one_identity_are_one_and_those_of_one_log_too():
    found = match_drives(
        {"a": scored("1"), "b": scored("2"), "c": scored("3")},
        {"moved": scored("2"), "a": scored("1"), "new": scored("9")},
    )
    assert (found.pairs, found.by_log) == ((("a", "a"), ("b", "moved")), 1)
    assert found.left_out == (
        LeftOut("c", "base", LeftOutBecause.ONLY_THERE),
        LeftOut("new", "new", LeftOutBecause.ONLY_THERE),
    )


def test_a_log_that_is_in_a_fleet_twice_is_matched_twice_and_no_more():
    found = match_drives(
        {"a": scored(), "b": scored(), "c": scored()}, {"x": scored(), "y": scored()}
    )
    assert found.pairs == (("a", "x"), ("b", "y"))
    assert [each.drive for each in found.left_out] == ["c"]


def test_one_identity_with_another_log_is_no_match():
    found = match_drives({"a": scored("1")}, {"a": scored("2")})
    assert found.pairs == ()
    assert found.left_out == (LeftOut("a", "base", LeftOutBecause.OTHER_LOG),)


def test_drives_that_were_not_scored_or_have_no_digest_are_not_matched_by_their_log():
    unknown = FleetDrive(None, scored=True)
    failed = FleetDrive(None, scored=False)
    assert match_drives({"a": unknown}, {"b": unknown}).pairs == ()
    (left,) = match_drives({"a": failed}, {"a": scored()}).left_out
    assert left.because is LeftOutBecause.NOT_SCORED
