/* The sum of decision trees: the classifier of roadeval/pipeline/beyond/trees.py. */

#include <string.h>

#include "loops.h"

/* The number of pixels in a block. With a hundred features, a block fits into the second cache. */
#define BLOCK 256

/* The greatest number of leaves of a tree. Each leaf has a bit. */
#define LEAVES 32

/* The number of nodes that a pass over the block evaluates together. */
#define ABREAST 4

/* Return a word with all bits set if a value is above another, else 0. */
PART uint32_t all_if_above(float value, float other) { return -(uint32_t)(value > other); }

/* Evaluate four nodes, and rule out the leaves that each pixel of a block can no longer reach. */
PART void pass_nodes(
    const float *restrict block, const int32_t *feature, const float *threshold,
    const uint32_t *kept, uint32_t *restrict ruled_out)
{
    const float *a = block + (int64_t)feature[0] * BLOCK, *b = block + (int64_t)feature[1] * BLOCK;
    const float *c = block + (int64_t)feature[2] * BLOCK, *d = block + (int64_t)feature[3] * BLOCK;
    const float of_a = threshold[0], of_b = threshold[1], of_c = threshold[2], of_d = threshold[3];
    const uint32_t out_a = ~kept[0], out_b = ~kept[1], out_c = ~kept[2], out_d = ~kept[3];
    for (int pixel = 0; pixel < BLOCK; pixel++) {
        uint32_t out = (all_if_above(a[pixel], of_a) & out_a);
        out |= all_if_above(b[pixel], of_b) & out_b;
        out |= all_if_above(c[pixel], of_c) & out_c;
        out |= all_if_above(d[pixel], of_d) & out_d;
        ruled_out[pixel] |= out;
    }
}

/* Compute the sum of the trees for each pixel.
 *
 * `features` has `pixels` elements for each of `count` features. `feature`, `threshold` and `kept`
 * have `nodes` elements for each of `trees` trees; `nodes` is a multiple of ABREAST. `values` has
 * LEAVES elements for each tree. `block` is working memory of BLOCK elements for each feature. */
LOOP void tree_sum(
    const float *features, int64_t count, int64_t pixels, const int32_t *feature,
    const float *threshold, const uint32_t *kept, const float *values, int64_t trees,
    int64_t nodes, float *restrict block, float *restrict result)
{
    float total[BLOCK];
    uint32_t out[BLOCK];
    for (int64_t start = 0; start < pixels; start += BLOCK) {
        /* The last block may have fewer pixels. Results beyond its end are not copied. */
        size_t size = (size_t)least(BLOCK, pixels - start) * sizeof(float);
        memset(total, 0, sizeof total);
        for (int64_t place = 0; place < count; place++)
            memcpy(block + place * BLOCK, features + place * pixels + start, size);
        for (int64_t tree = 0; tree < trees; tree++) {
            int64_t first = tree * nodes;
            memset(out, 0, sizeof out);
            for (int64_t node = first; node < first + nodes; node += ABREAST)
                pass_nodes(block, feature + node, threshold + node, kept + node, out);
            for (int pixel = 0; pixel < BLOCK; pixel++)
                total[pixel] += values[tree * LEAVES + lowest(~out[pixel])];
        }
        memcpy(result + start, total, size);
    }
}
