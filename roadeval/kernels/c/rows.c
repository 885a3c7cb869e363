/* Loops over the rows of a PNG file. */

#include <stdlib.h>

#include "loops.h"

enum { NONE, LEFT, ABOVE, MEAN, PAETH };

/* Of left, above, and the byte above the left one, that which is nearest to left + above - it. */
PART uint8_t nearest(int left, int above, int corner)
{
    int to_left = abs(above - corner), to_above = abs(left - corner);
    int to_corner = abs(left + above - 2 * corner);
    if (to_left <= to_above && to_left <= to_corner)
        return (uint8_t)left;
    return (uint8_t)(to_above <= to_corner ? above : corner);
}

/* Each channel by itself, so that the byte to the left stays in a register. */
PART void left_of_channel(const uint8_t *line, uint8_t *row, int64_t size, int64_t step)
{
    uint8_t left = 0;
    for (int64_t byte = 0; byte < size; byte += step)
        row[byte] = left = (uint8_t)(line[byte] + left);
}

PART void mean_of_channel(
    const uint8_t *line, const uint8_t *above, uint8_t *row, int64_t size, int64_t step)
{
    uint8_t left = 0;
    for (int64_t byte = 0; byte < size; byte += step)
        row[byte] = left = (uint8_t)(line[byte] + (left + above[byte]) / 2);
}

PART void paeth_of_channel(
    const uint8_t *line, const uint8_t *above, uint8_t *row, int64_t size, int64_t step)
{
    uint8_t left = 0, corner = 0;
    for (int64_t byte = 0; byte < size; byte += step) {
        row[byte] = left = (uint8_t)(line[byte] + nearest(left, above[byte], corner));
        corner = above[byte];
    }
}

/* What a filter takes from a byte. */
PART int taken(int kind, int left, int above)
{
    return kind == LEFT ? left : kind == ABOVE ? above : (left + above) / 2;
}

/* `rows`: height x size. `lines`: height x (1 + size). */
LOOP void filter_rows(
    const uint8_t *restrict rows, int64_t height, int64_t size, int64_t step, int kind,
    uint8_t *restrict lines)
{
    int64_t first = least(step, size);
    for (int64_t y = 0; y < height; y++) {
        const uint8_t *row = rows + y * size, *above = y > 0 ? row - size : row;
        uint8_t *restrict line = lines + y * (1 + size) + 1;
        line[-1] = (uint8_t)kind;
        for (int64_t byte = 0; byte < first; byte++)
            line[byte] = (uint8_t)(row[byte] - taken(kind, 0, y > 0 ? above[byte] : 0));
        for (int64_t byte = first; byte < size; byte++) {
            int left = row[byte - step], over = y > 0 ? above[byte] : 0;
            line[byte] = (uint8_t)(row[byte] - taken(kind, left, over));
        }
    }
}

/* `lines`: height x (1 + size). `rows`: (1 + height) x size, the first row cleared: what is above
 * the image. */
LOOP void unfilter_rows(
    const uint8_t *restrict lines, int64_t height, int64_t size, int64_t step, uint8_t *rows)
{
    for (int64_t y = 0; y < height; y++) {
        const uint8_t *restrict line = lines + y * (1 + size) + 1;
        const uint8_t *restrict above = rows + y * size;
        uint8_t *restrict row = rows + (y + 1) * size;
        int filter = line[-1];
        if (filter == ABOVE || filter == NONE) {
            for (int64_t byte = 0; byte < size; byte++)
                row[byte] = (uint8_t)(line[byte] + (filter == ABOVE ? above[byte] : 0));
            continue;
        }
        for (int64_t channel = 0; channel < step && channel < size; channel++) {
            int64_t rest = size - channel;
            if (filter == LEFT)
                left_of_channel(line + channel, row + channel, rest, step);
            else if (filter == MEAN)
                mean_of_channel(line + channel, above + channel, row + channel, rest, step);
            else
                paeth_of_channel(line + channel, above + channel, row + channel, rest, step);
        }
    }
}
