"""What a frame leaves for the next one is the same, whichever threads work."""

import random
import time

import numpy as np
import pytest

from roadeval.runtime.relay import Relay
from roadeval.runtime.threads import ordered


def blended(jobs, broken=(), frames=40):
    """Each frame mixes its value with the one before; ``broken`` ones leave nothing."""
    relay, pause = Relay(["a", "b"]), random.Random(jobs)
    values = np.random.default_rng(0).normal(size=frames)
    naps = [pause.random() / 1000 for _ in range(2 * frames)]

    def work(item):
        number, turn = item
        with turn:
            time.sleep(naps[number])
            if number in broken:
                return None
            past = turn.batons["a"].recall()
            now = values[number] if past is None else 0.7 * past + 0.3 * values[number]
            turn.batons["a"].leave(now)
            time.sleep(naps[-number])
            return now

    return list(ordered(work, ((number, relay.turn()) for number in range(frames)), jobs))


@pytest.mark.parametrize("jobs", [2, 3, 8])
def test_any_number_of_threads_gives_the_same(jobs):
    assert blended(jobs) == blended(1)


def test_a_frame_that_fails_hands_on_what_it_was_given():
    found = blended(4, broken={0, 7, 8})
    assert [found[n] for n in (0, 7, 8)] == [None, None, None]
    assert found == blended(1, broken={0, 7, 8})


def test_an_error_in_a_frame_leaves_no_frame_waiting():
    relay = Relay(["a"])

    def work(item):
        number, turn = item
        with turn:
            turn.batons["a"].recall()
            if number == 3:
                raise RuntimeError("broken frame")
            return number

    with pytest.raises(RuntimeError, match="broken frame"):
        list(ordered(work, ((number, relay.turn()) for number in range(20)), 4))


def test_variants_do_not_see_each_others_values():
    relay = Relay(["a", "b"])
    with relay.turn() as turn:
        turn.batons["a"].leave(1)
    with relay.turn() as turn:
        assert (turn.batons["a"].recall(), turn.batons["b"].recall()) == (1, None)


def test_a_frame_that_leaves_nothing_hands_on_the_value():
    relay = Relay(["a"])
    with relay.turn() as turn:
        turn.batons["a"].leave("kept")
    with relay.turn():
        pass
    with relay.turn() as turn:
        assert turn.batons["a"].recall() == "kept"
