/* Loops over the pixels of an image: tables of colours, and the distance of Eq. 2. */

#include <math.h>

#include "loops.h"

/* `codes` as many as pixels; `histogram` 256; `row`: `width` for what lies between two steps. */
LOOP void look_up_sum_min(
    const uint8_t *restrict red, const uint8_t *restrict green, const uint8_t *restrict blue,
    int64_t height, int64_t width, const uint8_t *restrict table,
    uint8_t *restrict codes, int64_t *restrict histogram, int32_t *restrict row)
{
    /* Four counters for each code, so that equal neighbours need not wait for each other. */
    int32_t counters[4][256] = {{0}};
    for (int64_t y = 0; y < height; y++) {
        const uint8_t *r = red + y * width, *g = green + y * width, *b = blue + y * width;
        uint8_t *code = codes + y * width;
        for (int64_t x = 0; x < width; x++) {
            int32_t darker = r[x] < g[x] ? r[x] : g[x];
            int32_t sum = r[x] + g[x] + b[x];
            row[x] = (sum << 8) + (darker < b[x] ? darker : b[x]);
        }
        for (int64_t x = 0; x < width; x++)
            code[x] = table[row[x]];
        for (int64_t x = 0; x < width; x++)
            counters[x & 3][code[x]]++;
    }
    for (int each = 0; each < 256; each++) {
        histogram[each] = 0;
        for (int counter = 0; counter < 4; counter++)
            histogram[each] += counters[counter][each];
    }
}

/* A bound on the rounding of a distance near the limit in single precision.
 *
 * A rounding is 2^-24 of a number. Each of the three components is off by six roundings of
 * `reach`, their norm by sqrt(3) times as much, and by three more of its own: 16 are enough. */
PART double rounding(const double *w, double limit)
{
    double reach = 0;
    for (int row = 0; row < 3; row++) {
        double total = fabs(w[3 * row]) + fabs(w[3 * row + 1]) + fabs(w[3 * row + 2]);
        reach = fmax(reach, 255 * total);
    }
    return 16 * 0x1p-24 * (reach + limit);
}

/* |W (x - m)|^2 in double and in single precision. */
PART double squared(double r, double g, double b, const double *m, const double *w)
{
    r -= m[0], g -= m[1], b -= m[2];
    double first = w[0] * r, second = w[3] * r + w[4] * g;
    double third = w[6] * r + w[7] * g + w[8] * b;
    return first * first + second * second + third * third;
}

PART float squared_single(float r, float g, float b, const float *m, const float *w)
{
    r -= m[0], g -= m[1], b -= m[2];
    float first = w[0] * r, second = w[3] * r + w[4] * g;
    float third = w[6] * r + w[7] * g + w[8] * b;
    return first * first + second * second + third * third;
}

/* Twice as many numbers of single precision fit into a vector, and it decides nearly every pixel.
 * Those that lie too close to the limit for it are decided in double precision. */
LOOP void mahalanobis(
    const uint8_t *restrict red, const uint8_t *restrict green, const uint8_t *restrict blue,
    int64_t height, int64_t width, const double *mean, const double *whitening, double greatest,
    float *restrict distance, uint8_t *restrict near)
{
    float m[3], w[9];
    for (int each = 0; each < 3; each++)
        m[each] = (float)mean[each];
    for (int each = 0; each < 9; each++)
        w[each] = (float)whitening[each];
    double limit = sqrt(greatest), error = rounding(whitening, limit);
    float surely = (float)(limit - error), perhaps = (float)(limit + error);
    for (int64_t y = 0; y < height; y++) {
        const uint8_t *r = red + y * width, *g = green + y * width, *b = blue + y * width;
        float *d = distance + y * width;
        uint8_t *n = near + y * width, undecided = 0;
        for (int64_t x = 0; x < width; x++)
            d[x] = sqrtf(squared_single(r[x], g[x], b[x], m, w));
        for (int64_t x = 0; x < width; x++) {
            n[x] = d[x] <= surely;
            undecided |= n[x] ^ (uint8_t)(d[x] <= perhaps);
        }
        for (int64_t x = 0; undecided && x < width; x++)
            if (surely < d[x] && d[x] <= perhaps)
                n[x] = squared(r[x], g[x], b[x], mean, whitening) <= greatest;
    }
}

/* `words` and `bits`: `width` for what lies between two steps. */
LOOP void look_up_colours(
    const uint8_t *restrict red, const uint8_t *restrict green, const uint8_t *restrict blue,
    int64_t height, int64_t width, const uint64_t *restrict road,
    uint8_t *restrict result, int32_t *restrict words, uint8_t *restrict bits)
{
    for (int64_t y = 0; y < height; y++) {
        const uint8_t *r = red + y * width, *g = green + y * width, *b = blue + y * width;
        uint8_t *found = result + y * width;
        /* A row at a time: where its colours stand is found in vector instructions. */
        for (int64_t x = 0; x < width; x++) {
            words[x] = (r[x] >> 2) << 12 | (g[x] >> 2) << 6 | b[x] >> 2;
            bits[x] = (uint8_t)((r[x] & 3) << 4 | (g[x] & 3) << 2 | (b[x] & 3));
        }
        for (int64_t x = 0; x < width; x++)
            found[x] = road[words[x]] >> bits[x] & 1;
    }
}
