/* Sum of rectified planes: the decision of roadeval/pipeline/beyond/context.py. */

#include <string.h>

#include "loops.h"

/* Pixels at a time: with a dozen features each, they stay in the nearest cache. */
#define BLOCK 512

/* Add what two planes give for a block. `count` is known where this is inserted, so that the sum
 * over the features is unrolled, and the loop over the pixels runs in vector instructions. */
PART void add_planes(
    const float *restrict block, const int count, const float *planes, const float *bias,
    const float *weights, float *restrict total)
{
    for (int pixel = 0; pixel < BLOCK; pixel++) {
        float side = bias[0], next = bias[1];
#pragma GCC unroll 32
        for (int each = 0; each < count; each++) {
            float value = block[each * BLOCK + pixel];
            side += value * planes[each];
            next += value * planes[count + each];
        }
        total[pixel] += (side < 0 ? 0 : side) * weights[0];
        total[pixel] += (next < 0 ? 0 : next) * weights[1];
    }
}

PART void sum_planes(
    const float *features, const int count, int64_t pixels, const float *planes,
    const float *bias, const float *weights, int64_t plane_count, float *restrict block,
    float *restrict result)
{
    float total[BLOCK];
    for (int64_t start = 0; start < pixels; start += BLOCK) {
        /* The last block may be short: what lies beyond it is 0, and not handed out. */
        size_t size = (size_t)least(BLOCK, pixels - start) * sizeof(float);
        memset(block, 0, sizeof(float) * BLOCK * count);
        memset(total, 0, sizeof total);
        for (int each = 0; each < count; each++)
            memcpy(block + each * BLOCK, features + each * pixels + start, size);
        for (int64_t plane = 0; plane < plane_count; plane += 2)
            add_planes(block, count, planes + plane * count, bias + plane, weights + plane, total);
        memcpy(result + start, total, size);
    }
}

/* `features`: `pixels` for each of `count`; `planes`: `count` for each of
 * `plane_count`, an even number; `block`: BLOCK for each of `count`, to work in. */
LOOP void rectified_sum(
    const float *features, int64_t count, int64_t pixels, const float *planes,
    const float *bias, const float *weights, int64_t plane_count, float *restrict block,
    float *restrict result)
{
#define SUM(n) sum_planes(features, n, pixels, planes, bias, weights, plane_count, block, result)
    switch (count) {
    /* Nine features and two for each window of texture; or twelve and two. */
    case 9: SUM(9); break;
    case 11: SUM(11); break;
    case 13: SUM(13); break;
    case 14: SUM(14); break;
    case 15: SUM(15); break;
    case 17: SUM(17); break;
    case 19: SUM(19); break;
    case 21: SUM(21); break;
    case 23: SUM(23); break;
    case 25: SUM(25); break;
    default: SUM((int)count);
    }
#undef SUM
}
