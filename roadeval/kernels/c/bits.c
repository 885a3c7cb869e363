/* Loops over masks as bits: a word holds 64 pixels, the leftmost in its lowest bit. */

#include <string.h>

#include "loops.h"

/* `counts`: mask_count x class_count x region_count; `both`: as many as words. */
LOOP void count_bits(
    const uint64_t *restrict masks, int64_t mask_count, const uint64_t *restrict classes,
    int64_t class_count, const uint64_t *restrict regions, int64_t region_count, int64_t words,
    int64_t *restrict counts, uint64_t *restrict both)
{
    for (int64_t region = 0; region < region_count; region++) {
        /* Many regions are a part of the rows: the words before and after it hold no pixel. */
        const uint64_t *inside = regions + region * words;
        int64_t first = 0, last = words;
        while (last > 0 && !inside[last - 1])
            last--;
        while (first < last && !inside[first])
            first++;
        for (int64_t kind = 0; kind < class_count; kind++) {
            for (int64_t word = first; word < last; word++)
                both[word] = inside[word] & classes[kind * words + word];
            for (int64_t mask = 0; mask < mask_count; mask++) {
                int64_t total = 0;
                for (int64_t word = first; word < last; word++)
                    total += ones(masks[mask * words + word] & both[word]);
                counts[(mask * class_count + kind) * region_count + region] = total;
            }
        }
    }
}

/* --- Dilation and erosion --------------------------------------------------------------------- */

/* The bits of a row's last word that lie within the width. */
PART uint64_t within(int64_t width)
{
    return width % 64 ? ((uint64_t)1 << width % 64) - 1 : ~(uint64_t)0;
}

/* Set, or clear, what lies between rows and beyond their width. */
PART void surround(uint64_t *wide, int64_t size, int64_t across, int64_t width, uint64_t beyond)
{
    uint64_t inside = within(width);
    wide[0] = beyond;
    for (int64_t y = across; y < size; y += across) {
        wide[y] = beyond;
        wide[y - 1] = (wide[y - 1] & inside) | (beyond & ~inside);
    }
}

/* Set each pixel of `wider` that is set in `wide`, or `step` pixels left or right; not the ends. */
PART void widen(const uint64_t *restrict wide, uint64_t *restrict wider, int64_t size, int step)
{
    int back = 64 - step;
    for (int64_t word = 1; word < size - 1; word++) {
        uint64_t left = wide[word] << step | wide[word - 1] >> back;
        uint64_t right = wide[word] >> step | wide[word + 1] << back;
        wider[word] = wide[word] | left | right;
    }
}

PART void unite(uint64_t *restrict grown, const uint64_t *restrict more, int64_t size)
{
    for (int64_t word = 0; word < size; word++)
        grown[word] |= more[word];
}

/* The mask's rows lie in one array, with a word between them for what is outside the image:
 *
 *     wide:   | . | row 0 | . | row 1 | . | row 2 | . |      across = words in a row + 1
 *
 * so that the row that lies `away` rows below is the one away * across words later, and each step
 * below is one long loop, which runs in vector instructions.
 *
 * The element is a stack of stretches that narrow with the distance from its middle row:
 *
 *     away 2       # #          reach[2] = 1
 *     away 1     # # # #        reach[1] = 2
 *     away 0   # # # # # #      reach[0] = 3
 *
 * They are taken from the outermost inwards. Before each, `wide` is the mask widened by `done`
 * pixels to either side; widened further until `done` is reach[away] it is united with `grown`,
 * moved up and down by `away` rows. So no widening is done twice.
 *
 * Each word is XORed with `changed`, 0 or all ones, as it is read and as it is written: to erode is
 * to dilate the complement, with ones around the image, and to take the complement again.
 *
 * `room`: 3 * (1 + height * (words + 1)). */
PART void grow(
    const uint64_t *restrict bits, int64_t height, int64_t width, const int64_t *reach,
    int64_t reaches, uint64_t changed, uint64_t *room, uint64_t *restrict result)
{
    int64_t words = (width + 63) / 64, across = words + 1, size = 1 + height * across, done = 0;
    uint64_t *wide = room, *spare = wide + size, *grown = spare + size;
    for (int64_t y = 0; y < height; y++)
        for (int64_t word = 0; word < words; word++)
            wide[1 + y * across + word] = bits[y * words + word] ^ changed;
    surround(wide, size, across, width, changed);
    memset(grown, 0, (size_t)size * sizeof *grown);
    for (int64_t away = reaches - 1; away >= 0; away--) {
        while (done < reach[away]) {
            /* A set pixel is by now a stretch of 2 done + 1, or of done + 1 where the image's side
             * cuts it off: moved by no more than done + 1 it leaves no gap. A word moves by 63
             * bits at most. */
            int64_t step = least(least(reach[away] - done, done + 1), 63);
            widen(wide, spare, size, (int)step);
            uint64_t *other = wide;
            wide = spare, spare = other;
            surround(wide, size, across, width, changed);
            done += step;
        }
        if (away < height) {
            int64_t rest = size - away * across;
            unite(grown + away * across, wide, rest);
            if (away)
                unite(grown, wide + away * across, rest);
        }
    }
    /* What is outside is set where `changed` is, and has reached the first and the last rows. */
    int64_t edge = least(reaches - 1, height);
    for (int64_t y = 0; y < height; y++) {
        uint64_t reached = y < edge || y >= height - edge ? changed : 0;
        for (int64_t word = 0; word < words; word++)
            result[y * words + word] = (grown[1 + y * across + word] | reached) ^ changed;
    }
}

LOOP void dilate(
    const uint64_t *bits, int64_t height, int64_t width, const int64_t *reach, int64_t reaches,
    uint64_t *room, uint64_t *result)
{
    grow(bits, height, width, reach, reaches, 0, room, result);
}

LOOP void erode(
    const uint64_t *bits, int64_t height, int64_t width, const int64_t *reach, int64_t reaches,
    uint64_t *room, uint64_t *result)
{
    grow(bits, height, width, reach, reaches, ~(uint64_t)0, room, result);
}
