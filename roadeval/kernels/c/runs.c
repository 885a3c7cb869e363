/* Loops over the runs of masks: they find components and holes.
 *
 * A run is a stretch of equal pixels in a row, from `start` up to but not including `end`. A mask
 * that was opened and closed has only a few runs in each row. So a loop over its components visits
 * some thousand runs instead of all pixels.
 *
 * A mask is an array of `height` rows of words, see bits.c. The caller allocates working memory:
 * `rows` has height + 1 elements; `starts`, `ends` and `parents` have width / 2 + 1 a row. */

#include "loops.h"

/* Find the runs of ones (or of zeros, if not `inside`), row after row, and return their number.
 *
 * The runs of row y have the numbers from rows[y] up to but not including rows[y + 1]. The loop
 * goes from turn to turn. A turn is a bit that differs from the bit to its left:
 *
 *     here     . . # # # . . # #      the bit before the first counts as 0
 *     turns    . . ^ . . ^ . ^ .      a run begins at 2 and ends at 5, the next begins at 7
 *
 * Turns begin and end runs alternately. If no turn ends a run, it ends with the row. */
PART int64_t find_runs(
    const uint64_t *bits, int64_t height, int64_t width, bool inside,
    int64_t *restrict rows, int32_t *restrict starts, int32_t *restrict ends)
{
    int64_t words = (width + 63) / 64, count = 0;
    uint64_t others = inside ? 0 : ~(uint64_t)0;
    rows[0] = 0;
    for (int64_t y = 0; y < height; y++) {
        uint64_t before = 0;
        bool running = false;
        for (int64_t word = 0; word < words; word++) {
            uint64_t here = bits[y * words + word] ^ others;
            uint64_t turns = here ^ (here << 1 | before);
            before = here >> 63;
            for (; turns; turns &= turns - 1) {
                int64_t place = 64 * word + lowest(turns);
                if (place >= width)
                    break;
                if (running)
                    ends[count++] = (int32_t)place;
                else
                    starts[count] = (int32_t)place;
                running = !running;
            }
        }
        if (running)
            ends[count++] = (int32_t)width;
        rows[y + 1] = count;
    }
    return count;
}

/* Return the first run of a run's component. */
PART int64_t first_of(int64_t *parents, int64_t run)
{
    while (parents[run] != run)
        run = parents[run] = parents[parents[run]];
    return run;
}

/* Join the runs of neighbouring rows that touch. `parents` holds for each run the first run of its
 * component.
 *
 * If `corner` is 1, runs may touch at a corner (8-connected); else they must share a side. */
PART void join_runs(
    const int64_t *rows, const int32_t *starts, const int32_t *ends, int64_t height, int corner,
    int64_t *parents)
{
    for (int64_t run = 0; run < rows[height]; run++)
        parents[run] = run;
    for (int64_t y = 1; y < height; y++) {
        int64_t above = rows[y - 1], here = rows[y];
        while (above < rows[y] && here < rows[y + 1]) {
            if (starts[above] < ends[here] + corner && starts[here] < ends[above] + corner) {
                int64_t a = first_of(parents, above), b = first_of(parents, here);
                parents[a] = parents[b] = parents[here] = least(a, b);
            }
            /* The loop leaves the run that ends first. A branch here would be slow, because no
             * processor could predict it. */
            int64_t above_ends = ends[above] < ends[here];
            above += above_ends, here += 1 - above_ends;
        }
    }
    /* A parent comes before its child, so its own parent is final already. */
    for (int64_t run = 0; run < rows[height]; run++)
        parents[run] = parents[parents[run]];
}

/* Set the bits of a row from `start` up to but not including `end`. */
PART void set_bits(uint64_t *row, int64_t start, int64_t end)
{
    uint64_t part = ~(uint64_t)0 << start % 64;
    int64_t word = start / 64;
    for (; word < end / 64; word++) {
        row[word] |= part;
        part = ~(uint64_t)0;
    }
    if (end % 64)
        row[word] |= part & (((uint64_t)1 << end % 64) - 1);
}

/* Write `runs` with their labels, and return the number of components. */
LOOP int64_t components(
    const uint64_t *bits, int64_t height, int64_t width, int corner,
    int64_t *rows, int32_t *starts, int32_t *ends, int64_t *parents, run_t *runs)
{
    int32_t count = 0;
    find_runs(bits, height, width, true, rows, starts, ends);
    join_runs(rows, starts, ends, height, corner, parents);
    for (int64_t y = 0; y < height; y++)
        for (int64_t run = rows[y]; run < rows[y + 1]; run++) {
            /* The first run of a component comes before the others, and has its label already. */
            int32_t label = parents[run] == run ? ++count : runs[parents[run]].label;
            runs[run] = (run_t){(int32_t)y, starts[run], ends[run], label};
        }
    return count;
}

/* Keep the largest component. `votes` has as many elements as `parents`. The caller sets the
 * elements of `votes` and `kept` to 0. */
LOOP void keep_region(
    const uint64_t *bits, int64_t height, int64_t width,
    int64_t *rows, int32_t *starts, int32_t *ends, int64_t *parents, int64_t *votes,
    uint64_t *restrict kept)
{
    int64_t words = (width + 63) / 64;
    int64_t count = find_runs(bits, height, width, true, rows, starts, ends);
    join_runs(rows, starts, ends, height, 1, parents);
    for (int64_t run = 0; run < count; run++)
        votes[parents[run]] += ends[run] - starts[run];
    /* The number of a component is that of its first run. If several components have the same size,
     * the loop finds the topmost. */
    int64_t best = 0;
    for (int64_t run = 1; run < count; run++)
        best = votes[run] > votes[best] ? run : best;
    for (int64_t y = 0; y < height; y++)
        for (int64_t run = rows[y]; run < rows[y + 1]; run++)
            if (parents[run] == best)
                set_bits(kept + y * words, starts[run], ends[run]);
}

/* Fill the holes of a mask. `filled` begins as a copy of `bits`. `outside` has as many elements as
 * `parents`, and the caller sets them to 0. */
LOOP void fill_holes(
    const uint64_t *bits, int64_t height, int64_t width,
    int64_t *rows, int32_t *starts, int32_t *ends, int64_t *parents, uint8_t *outside,
    uint64_t *restrict filled)
{
    int64_t words = (width + 63) / 64;
    find_runs(bits, height, width, false, rows, starts, ends);
    join_runs(rows, starts, ends, height, 0, parents);
    for (int64_t y = 0; y < height; y++)
        for (int64_t run = rows[y]; run < rows[y + 1]; run++)
            if (y == 0 || y == height - 1 || starts[run] == 0 || ends[run] == width)
                outside[parents[run]] = true;
    for (int64_t y = 0; y < height; y++)
        for (int64_t run = rows[y]; run < rows[y + 1]; run++)
            if (!outside[parents[run]])
                set_bits(filled + y * words, starts[run], ends[run]);
}
