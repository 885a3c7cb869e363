/* Loops over masks by runs: components and holes.
 *
 * A run is a stretch of equal pixels in a row, from `start` up to but not including `end`. A mask
 * that was opened and closed has a few of them a row, so that what is asked of its components is
 * asked of some thousand runs instead of all pixels.
 *
 * A mask is `height` rows of `words`, see bits.c. `rows`, one more than rows, `starts` and `ends`,
 * width / 2 + 1 a row, and `parents`, as many, are given by the caller as room to work in. */

#include "loops.h"

/* Find the runs of ones (or of zeros, if not `inside`), row after row, and return how many.
 *
 * Those of row y are numbered from rows[y] up to but not including rows[y + 1]. A word is walked
 * from turn to turn, a bit that differs from the one to its left:
 *
 *     here     . . # # # . . # #      before the first stands a 0
 *     turns    . . ^ . . ^ . ^ .      a run begins at 2, ends at 5, begins at 7
 *
 * Turns alternate between beginning and end; a run that no turn ends, ends with the row. */
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

PART int64_t first_of(int64_t *parents, int64_t run)
{
    while (parents[run] != run)
        run = parents[run] = parents[parents[run]];
    return run;
}

/* Join runs of neighbouring rows that touch: `parents` becomes of each the first of its component.
 *
 * With `corner` 1 they may touch by a corner (8-connected), with 0 by a side alone. */
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
            /* Whichever ends first is done with. Not a branch, which no processor could foresee. */
            int64_t done = ends[above] < ends[here];
            above += done, here += 1 - done;
        }
    }
    /* A parent comes before its child, and is settled already. */
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
            /* A component's number is its first run's, which comes before the others. */
            int32_t label = parents[run] == run ? ++count : runs[parents[run]].label;
            runs[run] = (run_t){(int32_t)y, starts[run], ends[run], label};
        }
    return count;
}

/* `votes`: as many as `parents`, cleared; `kept` cleared. */
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
    /* A component's own number is its first run's: of equals the first from the top is found. */
    int64_t best = 0;
    for (int64_t run = 1; run < count; run++)
        best = votes[run] > votes[best] ? run : best;
    for (int64_t y = 0; y < height; y++)
        for (int64_t run = rows[y]; run < rows[y + 1]; run++)
            if (parents[run] == best)
                set_bits(kept + y * words, starts[run], ends[run]);
}

/* `filled`: a copy of `bits`; `outside` as many as `parents`, cleared. */
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
