/* Loops over masks as bits. A word holds 64 pixels, and its lowest bit is the leftmost pixel. */

#include <string.h>

#include "loops.h"

/* Count the pixels of each mask that lie in each class and region.
 *
 * `counts` has mask_count x class_count x region_count elements. `both` has `words` elements. */
LOOP void count_bits(
    const uint64_t *restrict masks, int64_t mask_count, const uint64_t *restrict classes,
    int64_t class_count, const uint64_t *restrict regions, int64_t region_count, int64_t words,
    int64_t *restrict counts, uint64_t *restrict both)
{
    for (int64_t region = 0; region < region_count; region++) {
        /* Many regions cover only some of the rows. The words before and after them are skipped. */
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

/* Return the bits of a row's last word that lie within the width. */
PART uint64_t within(int64_t width)
{
    return width % 64 ? ((uint64_t)1 << width % 64) - 1 : ~(uint64_t)0;
}

/* Give all pixels between the rows and beyond their width the value of `beyond`. */
PART void surround(uint64_t *wide, int64_t size, int64_t across, int64_t width, uint64_t beyond)
{
    uint64_t inside = within(width);
    wide[0] = beyond;
    for (int64_t y = across; y < size; y += across) {
        wide[y] = beyond;
        wide[y - 1] = (wide[y - 1] & inside) | (beyond & ~inside);
    }
}

/* Set a pixel of `wider` if `wide` has a set pixel there, or `step` pixels to its left or right.
 *
 * The first and the last word are not written. */
PART void widen(const uint64_t *restrict wide, uint64_t *restrict wider, int64_t size, int step)
{
    int back = 64 - step;
    for (int64_t word = 1; word < size - 1; word++) {
        uint64_t left = wide[word] << step | wide[word - 1] >> back;
        uint64_t right = wide[word] >> step | wide[word + 1] << back;
        wider[word] = wide[word] | left | right;
    }
}

/* Set the pixels of `grown` that are set in `more`. */
PART void unite(uint64_t *restrict grown, const uint64_t *restrict more, int64_t size)
{
    for (int64_t word = 0; word < size; word++)
        grown[word] |= more[word];
}

/* Dilate a mask by an element, or erode it.
 *
 * The mask's rows lie in one array. A word between two rows holds the pixels outside the image:
 *
 *     wide:   | . | row 0 | . | row 1 | . | row 2 | . |      across = words in a row + 1
 *
 * The row that lies `away` rows below therefore begins away * across words later, and each step is
 * one long loop, which runs in vector instructions.
 *
 * The element is a stack of stretches. A stretch is narrower the farther it is from the middle row:
 *
 *     away 2       # #          reach[2] = 1
 *     away 1     # # # #        reach[1] = 2
 *     away 0   # # # # # #      reach[0] = 3
 *
 * The loop goes from the outermost stretch to the middle row. `wide` is the mask, widened by
 * `done` pixels to the left and to the right. For each stretch `wide` is widened until `done` is
 * reach[away]. Then it is moved up and down by `away` rows, and united with `grown`. So no
 * widening is repeated.
 *
 * To erode a mask, the loop dilates its complement, with ones around the image, and returns the
 * complement of the result. For that it XORs each word with `changed`, which is 0 or all ones, when
 * it reads the word and when it writes it.
 *
 * `room` has 3 * (1 + height * (words + 1)) elements. */
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
            /* A set pixel has become a stretch of 2 * done + 1 pixels, or of done + 1 at the side
             * of the image. If it moves by at most done + 1 pixels, no gap remains. A word cannot
             * move by more than 63 bits. */
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
    /* If `changed` is all ones, the ones outside the image have spread into its outer rows. */
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
