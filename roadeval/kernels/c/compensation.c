/* Loops over the pixels of components and their rings, for Eq. 10 and 11.
 *
 * The pixels of a component are its runs, in the order of the rows, see runs.c. */

#include <math.h>
#include <string.h>

#include "loops.h"

/* A component with more pixels gets a table of the new level of each level, which is then faster
 * than computing the level of each pixel. */
#define TABLED 256

/* Sum the colours of the runs of every label.
 *
 * `sums` has seven elements for each label: the number of pixels, the sums of R, G and B, and the
 * sums of their squares. The caller sets them to 0. */
LOOP void run_sums(
    const uint8_t *restrict red, const uint8_t *restrict green, const uint8_t *restrict blue,
    int64_t width, const run_t *restrict runs, int64_t count, int64_t *restrict sums)
{
    for (const run_t *run = runs; run < runs + count; run++) {
        int64_t row = run->row * width, *sum = sums + 7 * (int64_t)run->label;
        int64_t r1 = 0, g1 = 0, b1 = 0, r2 = 0, g2 = 0, b2 = 0;
        for (int64_t at = row + run->start; at < row + run->end; at++) {
            int32_t r = red[at], g = green[at], b = blue[at];
            r1 += r, g1 += g, b1 += b;
            r2 += r * r, g2 += g * g, b2 += b * b;
        }
        sum[0] += run->end - run->start;
        sum[1] += r1, sum[2] += g1, sum[3] += b1;
        sum[4] += r2, sum[5] += g2, sum[6] += b2;
    }
}

/* --- Rings ------------------------------------------------------------------------------------ */

/* Add the ring's pixels in a stretch of a row to the sums of a component. */
PART void add(
    int64_t *restrict sum, RGB, const uint64_t *ring, int64_t row, int64_t start, int64_t end)
{
    uint64_t part = ~(uint64_t)0 << start % 64;
    int64_t pixels = 0, r1 = 0, g1 = 0, b1 = 0, r2 = 0, g2 = 0, b2 = 0;
    for (int64_t word = start / 64, last = (end - 1) / 64; word <= last; word++) {
        uint64_t rest = ring[word] & part;
        part = ~(uint64_t)0;
        if (word == last)
            rest &= part >> (63 - (end - 1) % 64);
        for (; rest; rest &= rest - 1) {
            int64_t at = row + 64 * word + lowest(rest);
            int64_t r = red[at], g = green[at], b = blue[at];
            pixels++;
            r1 += r, g1 += g, b1 += b;
            r2 += r * r, g2 += g * g, b2 += b * b;
        }
    }
    sum[0] += pixels;
    sum[1] += r1, sum[2] += g1, sum[3] += b1;
    sum[4] += r2, sum[5] += g2, sum[6] += b2;
}

/* Sum the colours of every component's ring.
 *
 * A ring pixel of row y belongs to a component if it lies within `reach` columns of one of the
 * component's runs in the rows y - reach to y + reach. With a reach of 1 and one component:
 *
 *     row y - 1      . . . # # # . . . . .
 *     row y          . o o o o o o o o o .     o: columns 1 to 9
 *     row y + 1      . . # # . . # # # . .
 *
 * The widened runs overlap, but each pixel must be counted once. So the loop takes the runs of all
 * these rows from left to right by their first columns; `upcoming` is the next run of each row.
 * `reached` is the invariant: all pixels of the component in row y that lie left of this column are
 * counted already. A widened run adds its pixels from this column on, and moves the column to its
 * end. The column is stored as y * width + column, so it need not be cleared before the next row.
 *
 * `first` has the first run of each row, with `reach` empty rows above and below the image, and one
 * element more. `sums` has seven elements for each label, and `reached` has one. The caller sets
 * them to 0. `merge` is working memory of 3 * (2 * reach + 1) elements. */
LOOP void ring_sums(
    const uint8_t *red, const uint8_t *green, const uint8_t *blue,
    int64_t height, int64_t width, const run_t *runs, const int64_t *first,
    const uint64_t *ring, int64_t words, int64_t reach,
    int64_t *restrict sums, int64_t *restrict reached, int64_t *restrict merge)
{
    const int64_t rows = 2 * reach + 1;
    /* Each row within reach has its next run, the start of that run, and the run after its last. */
    int64_t *upcoming = merge, *starts = merge + rows, *ends = merge + 2 * rows;
    for (int64_t y = 0; y < height; y++) {
        for (int64_t row = 0; row < rows; row++) {
            upcoming[row] = first[y + row], ends[row] = first[y + row + 1];
            starts[row] = upcoming[row] < ends[row] ? runs[upcoming[row]].start : width;
        }
        for (;;) {
            int64_t row = 0, leftmost = starts[0];
            for (int64_t other = 1; other < rows; other++) {
                row = starts[other] < leftmost ? other : row;
                leftmost = least(leftmost, starts[other]);
            }
            if (leftmost == width)
                break;
            const run_t *run = runs + upcoming[row]++;
            starts[row] = upcoming[row] < ends[row] ? runs[upcoming[row]].start : width;
            int64_t *until = reached + run->label;
            int64_t start = most(most(run->start - reach, 0), *until - y * width);
            int64_t end = least(run->end + reach, width);
            if (start < end) {
                *until = y * width + end;
                const uint64_t *in_row = ring + y * words;
                int64_t *sum = sums + 7 * (int64_t)run->label;
                add(sum, red, green, blue, in_row, y * width, start, end);
            }
        }
    }
}

/* --- Transfer --------------------------------------------------------------------------------- */

/* Return the level that a level becomes, rounded and clipped. */
PART uint8_t moved(double level, double source, double target, double gain)
{
    double value = rint(target + (level - source) * gain);
    return (uint8_t)(value > 0 ? (value < 255 ? value : 255) : 0);
}

/* Map the colours of each component to its target.
 *
 * `image` is changed in place. `source`, `target` and `gain` have three elements for each of
 * `count` labels. `pixels` has one element for each label, which the caller sets to 0. `tables` has
 * 768 elements for each label with more than TABLED pixels. */
LOOP void transfer(
    uint8_t *restrict image, int64_t width, const run_t *restrict runs, int64_t run_count,
    const double *restrict source, const double *restrict target, const double *restrict gain,
    int64_t count, int64_t *restrict pixels, uint8_t *restrict tables)
{
    for (const run_t *run = runs; run < runs + run_count; run++)
        pixels[run->label] += run->end - run->start;
    /* From here on `pixels` holds the place of each label's table, or -1 if it has none. */
    int64_t place = 0;
    for (int64_t k = 0; k < count; k++) {
        if (pixels[k] <= TABLED) {
            pixels[k] = -1;
            continue;
        }
        uint8_t *table = tables + 768 * place;
        for (int c = 0; c < 3; c++)
            for (int level = 0; level < 256; level++)
                *table++ = moved(level, source[3 * k + c], target[3 * k + c], gain[3 * k + c]);
        pixels[k] = place++;
    }
    for (const run_t *run = runs; run < runs + run_count; run++) {
        int64_t k = run->label;
        uint8_t *at = image + 3 * (run->row * width + run->start);
        uint8_t *end = image + 3 * (run->row * width + run->end);
        const uint8_t *table = tables + 768 * pixels[k];
        if (pixels[k] < 0)
            for (; at < end; at += 3)
                for (int c = 0; c < 3; c++)
                    at[c] = moved(at[c], source[3 * k + c], target[3 * k + c], gain[3 * k + c]);
        else
            for (; at < end; at += 3)
                at[0] = table[at[0]], at[1] = table[256 + at[1]], at[2] = table[512 + at[2]];
    }
}
