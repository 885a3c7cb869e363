/* Loops over the pixels of an image: they look colours up, and compute the distance of Eq. 2. */

#include <math.h>

#include "loops.h"

/* Look every pixel up by the sum and the minimum of its channels.
 *
 * `codes` has an element for each pixel, `histogram` has 256. `row` is working memory of `width`
 * elements. */
LOOP void look_up_sum_min(
    const uint8_t *restrict red, const uint8_t *restrict green, const uint8_t *restrict blue,
    int64_t height, int64_t width, const uint8_t *restrict table,
    uint8_t *restrict codes, int64_t *restrict histogram, int32_t *restrict row)
{
    /* With four counters for each code, a pixel need not wait for an equal neighbour's count. */
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
    for (int code = 0; code < 256; code++) {
        histogram[code] = 0;
        for (int counter = 0; counter < 4; counter++)
            histogram[code] += counters[counter][code];
    }
}

/* Return a bound on the rounding error of a distance near the limit in single precision.
 *
 * One rounding changes a number by at most 2^-24 of it. Each of the three components has an error
 * of at most six roundings of `reach`. The norm has sqrt(3) times that error, and three roundings
 * of its own. So 16 roundings are enough. */
PART double rounding(const double *w, double limit)
{
    double reach = 0;
    for (int row = 0; row < 3; row++) {
        double total = fabs(w[3 * row]) + fabs(w[3 * row + 1]) + fabs(w[3 * row + 2]);
        reach = fmax(reach, 255 * total);
    }
    return 16 * 0x1p-24 * (reach + limit);
}

/* Return |W (x - m)|^2 in double precision. */
PART double squared(double r, double g, double b, const double *m, const double *w)
{
    r -= m[0], g -= m[1], b -= m[2];
    double first = w[0] * r, second = w[3] * r + w[4] * g;
    double third = w[6] * r + w[7] * g + w[8] * b;
    return first * first + second * second + third * third;
}

/* Return |W (x - m)|^2 in single precision. */
PART float squared_single(float r, float g, float b, const float *m, const float *w)
{
    r -= m[0], g -= m[1], b -= m[2];
    float first = w[0] * r, second = w[3] * r + w[4] * g;
    float third = w[6] * r + w[7] * g + w[8] * b;
    return first * first + second * second + third * third;
}

/* Compute the distance of every pixel, and decide which pixels are near.
 *
 * Single precision is faster, because twice as many numbers fit into a vector, and it decides
 * nearly every pixel. Double precision decides the pixels that lie too close to the limit. */
LOOP void mahalanobis(
    const uint8_t *restrict red, const uint8_t *restrict green, const uint8_t *restrict blue,
    int64_t height, int64_t width, const double *mean, const double *whitening, double greatest,
    float *restrict distance, uint8_t *restrict near)
{
    float m[3], w[9];
    for (int channel = 0; channel < 3; channel++)
        m[channel] = (float)mean[channel];
    for (int place = 0; place < 9; place++)
        w[place] = (float)whitening[place];
    double limit = sqrt(greatest), error = rounding(whitening, limit);
    float lower_limit = (float)(limit - error), upper_limit = (float)(limit + error);
    for (int64_t y = 0; y < height; y++) {
        const uint8_t *r = red + y * width, *g = green + y * width, *b = blue + y * width;
        float *d = distance + y * width;
        uint8_t *n = near + y * width, undecided = 0;
        for (int64_t x = 0; x < width; x++)
            d[x] = sqrtf(squared_single(r[x], g[x], b[x], m, w));
        for (int64_t x = 0; x < width; x++) {
            n[x] = d[x] <= lower_limit;
            undecided |= n[x] ^ (uint8_t)(d[x] <= upper_limit);
        }
        for (int64_t x = 0; undecided && x < width; x++)
            if (lower_limit < d[x] && d[x] <= upper_limit)
                n[x] = squared(r[x], g[x], b[x], mean, whitening) <= greatest;
    }
}

/* Look every pixel up in a table over all colours, which has a bit for each colour.
 *
 * `words` and `bits` are working memory of `width` elements. */
LOOP void look_up_colours(
    const uint8_t *restrict red, const uint8_t *restrict green, const uint8_t *restrict blue,
    int64_t height, int64_t width, const uint64_t *restrict road,
    uint8_t *restrict result, int32_t *restrict words, uint8_t *restrict bits)
{
    for (int64_t y = 0; y < height; y++) {
        const uint8_t *r = red + y * width, *g = green + y * width, *b = blue + y * width;
        uint8_t *is_road = result + y * width;
        /* The places of a row's colours in the table are computed in vector instructions. */
        for (int64_t x = 0; x < width; x++) {
            words[x] = (r[x] >> 2) << 12 | (g[x] >> 2) << 6 | b[x] >> 2;
            bits[x] = (uint8_t)((r[x] & 3) << 4 | (g[x] & 3) << 2 | (b[x] & 3));
        }
        for (int64_t x = 0; x < width; x++)
            is_road[x] = road[words[x]] >> bits[x] & 1;
    }
}
