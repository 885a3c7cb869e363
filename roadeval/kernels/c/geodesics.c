/* Geodesic distances: the length of the cheapest path from the seeds to each pixel. */

#include "loops.h"

/* No distance is greater, as in plain.py. */
#define FAR (1 << 30)

/* A step costs the sum of its two pixels' costs, times 5 if it is straight, or 7 if it is
 * diagonal. */
#define STRAIGHT 5
#define ASLANT 7

PART int32_t lesser(int32_t a, int32_t b) { return a < b ? a : b; }

/* Shorten a row's paths by the steps from the row beside it. */
PART void across_rows(
    const uint16_t *cost, const uint16_t *beside, const int32_t *from, int64_t width,
    int32_t *restrict distance)
{
    for (int64_t x = 0; x < width; x++)
        distance[x] = lesser(distance[x], from[x] + STRAIGHT * (cost[x] + beside[x]));
    for (int64_t x = 1; x < width; x++)
        distance[x] = lesser(distance[x], from[x - 1] + ASLANT * (cost[x] + beside[x - 1]));
    for (int64_t x = 1; x < width; x++)
        distance[x - 1] = lesser(distance[x - 1], from[x] + ASLANT * (cost[x - 1] + beside[x]));
}

/* Shorten a row's paths by the steps within it, to the right and then to the left. */
PART void along_row(const uint16_t *cost, int64_t width, int32_t *restrict distance)
{
    int32_t last = distance[0];
    for (int64_t x = 1; x < width; x++)
        distance[x] = last = lesser(distance[x], last + STRAIGHT * (cost[x] + cost[x - 1]));
    for (int64_t x = width - 2; x >= 0; x--)
        distance[x] = last = lesser(distance[x], last + STRAIGHT * (cost[x] + cost[x + 1]));
}

/* Compute the length of the cheapest path to each pixel; a seed has the distance 0. */
LOOP void geodesics(
    const uint16_t *cost, const uint8_t *seeds, int64_t height, int64_t width, int64_t rounds,
    int32_t *restrict distance)
{
    for (int64_t pixel = 0; pixel < height * width; pixel++)
        distance[pixel] = seeds[pixel] ? 0 : FAR;
    if (width == 0)
        return;
    for (int64_t sweep = 0; sweep < 2 * rounds; sweep++) {
        /* A sweep goes up, the next one goes down. */
        int64_t step = sweep % 2 ? width : -width;
        int64_t row = sweep % 2 ? 0 : (height - 1) * width;
        for (int64_t y = 0; y < height; y++, row += step) {
            const uint16_t *costs = cost + row;
            if (y > 0)
                across_rows(costs, costs - step, distance + row - step, width, distance + row);
            along_row(costs, width, distance + row);
        }
    }
}
