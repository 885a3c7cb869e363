/* Loops over the rows of a PNG file. */

#include <stdlib.h>

#include "loops.h"

enum { NONE = 0, PAETH = 4 };

/* Return the Paeth predictor: of left, above and corner the byte that is nearest to
 * left + above - corner. The corner is the byte above the left one. */
PART uint8_t nearest(int left, int above, int corner)
{
    int to_left = abs(above - corner), to_above = abs(left - corner);
    int to_corner = abs(left + above - 2 * corner);
    if (to_left <= to_above && to_left <= to_corner)
        return (uint8_t)left;
    return (uint8_t)(to_above <= to_corner ? above : corner);
}

/* Subtract the Paeth predictor from each byte.
 *
 * `rows` has height x size elements. `lines` has height x (1 + size). */
LOOP void filter_rows(
    const uint8_t *restrict rows, int64_t height, int64_t size, int64_t step,
    uint8_t *restrict lines)
{
    int64_t first = least(step, size);
    for (int64_t y = 0; y < height; y++) {
        const uint8_t *row = rows + y * size, *above = y > 0 ? row - size : row;
        uint8_t *restrict line = lines + y * (1 + size) + 1;
        line[-1] = PAETH;
        /* In the first pixel left and corner are 0, so above is the nearest byte. In the first row
         * above and corner are 0, so left is the nearest byte. */
        for (int64_t byte = 0; byte < first; byte++)
            line[byte] = (uint8_t)(row[byte] - (y > 0 ? above[byte] : 0));
        if (y > 0)
            for (int64_t byte = first; byte < size; byte++)
                line[byte] = (uint8_t)(row[byte]
                    - nearest(row[byte - step], above[byte], above[byte - step]));
        else
            for (int64_t byte = first; byte < size; byte++)
                line[byte] = (uint8_t)(row[byte] - row[byte - step]);
    }
}

/* Pack a row of labels. Every caller gives a constant for `bits`, so the compiler unrolls the
 * loops. */
PART void pack_row(
    const uint8_t *restrict labels, int64_t width, int bits, uint8_t *restrict line)
{
    int64_t per_byte = 8 / bits, whole = width / per_byte;
    unsigned most = (1u << bits) - 1;
    for (int64_t byte = 0; byte < whole; byte++) {
        unsigned packed = 0;
        for (int64_t place = 0; place < per_byte; place++)
            packed = packed << bits | (labels[byte * per_byte + place] & most);
        line[byte] = (uint8_t)packed;
    }
    if (whole * per_byte < width) {
        unsigned packed = 0;
        for (int64_t place = whole * per_byte; place < (whole + 1) * per_byte; place++)
            packed = packed << bits | (place < width ? labels[place] & most : 0);
        line[whole] = (uint8_t)packed;
    }
}

/* Pack labels, the leftmost into a byte's highest bits.
 *
 * `labels` has height x width elements. `bits` is 2, 4 or 8. `lines` has height x (1 + bytes of a
 * row) elements. */
LOOP void label_rows(
    const uint8_t *restrict labels, int64_t height, int64_t width, int bits,
    uint8_t *restrict lines)
{
    int64_t size = 1 + (width * bits + 7) / 8;
    for (int64_t y = 0; y < height; y++) {
        const uint8_t *row = labels + y * width;
        uint8_t *line = lines + y * size + 1;
        line[-1] = NONE;
        if (bits == 2)
            pack_row(row, width, 2, line);
        else if (bits == 4)
            pack_row(row, width, 4, line);
        else
            pack_row(row, width, 8, line);
    }
}
