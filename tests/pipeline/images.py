"""Small images that the pipeline's tests share: odd ones by name, and random ones."""

from typing import Final

import numpy as np
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

LIT: Final = (180, 180, 170)
"""A colour of low NDI."""
DARK: Final = (10, 10, 60)
"""A colour of high NDI."""


def picture(*rows):
    """Draw an image: ``.`` lit, ``#`` shadow, both with some texture."""
    drawn = np.array([list(row) for row in rows])
    texture = np.arange(drawn.size * 3).reshape(*drawn.shape, 3) * 7 % 11
    image = np.where((drawn == "#")[..., None], DARK, LIT)
    return (image + texture).astype(np.uint8)


def mask(*rows):
    """Draw a mask: ``#`` is 1."""
    return (np.array([list(row) for row in rows]) == "#").astype(np.uint8)


def noise(height, width, seed=0):
    return np.random.default_rng(seed).integers(0, 256, (height, width, 3), dtype=np.uint8)


IMAGES: Final = {
    "one pixel": picture("."),
    "one row": picture("..##.#...#"),
    "one column": picture(*"..##.#"),
    "black": np.zeros((4, 5, 3), np.uint8),
    "white": np.full((4, 5, 3), 255, np.uint8),
    "a single colour": np.full((4, 5, 3), DARK, np.uint8),
    "black border": np.pad(noise(6, 6), ((2, 2), (2, 2), (0, 0))),
    "noise, thousands of components": noise(150, 200),
    "rings of width 3 that meet": picture(
        *["............"] * 3, "...#....#...", "...#....#...", *["............"] * 3
    ),
    "shadow at every border": picture("##..#", "#....", "....#", "#..##"),
    "shadow inside shadow": picture(".......", ".#####.", ".#...#.", ".#.#.#.", ".#####."),
    "diagonal neighbours": picture("#.#.", ".#.#", "#.#."),
    "all but one pixel": picture("####", "#.##", "####"),
}

sides = st.integers(1, 9)


PALETTES: Final = ([LIT, DARK], [LIT, DARK, (12, 10, 60), (0, 0, 0)])


@st.composite
def images(draw):
    """Random images up to 9x9: of all colours, or of few, so that statistics tie."""
    shape = (draw(sides), draw(sides))
    palette = draw(st.sampled_from([None, *PALETTES]))
    if palette is None:
        return draw(hnp.arrays(np.uint8, (*shape, 3)))
    index = draw(hnp.arrays(np.intp, shape, elements=st.integers(0, len(palette) - 1)))
    return np.array(palette, np.uint8)[index]


masks = hnp.arrays(np.uint8, st.tuples(sides, sides), elements=st.integers(0, 1))
