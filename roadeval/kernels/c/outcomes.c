/* Loops over how each pixel of a mask came out: see `ERRORS` in roadeval/data. */

#include "loops.h"

enum { FP = 2, FN = 3, IGNORED = 4 };

LOOP void outcomes(
    const uint8_t *restrict mask, const uint8_t *restrict truth, int64_t size,
    uint8_t *restrict errors)
{
    for (int64_t pixel = 0; pixel < size; pixel++) {
        /* TN 0 and TP 1 where the two agree, FP 2 and FN 3 where not; beyond 4 what is ignored. */
        uint8_t outcome = (uint8_t)(truth[pixel] + 2 * (truth[pixel] ^ mask[pixel]));
        errors[pixel] = outcome < IGNORED ? outcome : IGNORED;
    }
}

/* `totals`: three times as many as pixels: labelled, FP and FN. */
LOOP void add_outcomes(
    const uint8_t *restrict errors, int64_t size, uint8_t *restrict totals)
{
    uint8_t *restrict labelled = totals, *restrict fp = totals + size, *restrict fn = fp + size;
    for (int64_t pixel = 0; pixel < size; pixel++) {
        labelled[pixel] += errors[pixel] != IGNORED;
        fp[pixel] += errors[pixel] == FP;
        fn[pixel] += errors[pixel] == FN;
    }
}
