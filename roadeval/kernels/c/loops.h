/* This file declares the loops, and defines the macros and small functions that they share.
 *
 * The function of the same name in roadeval/kernels/plain.py defines each loop, bit for bit.
 * module.c checks the arrays of a loop, and roadeval/kernels/compiled.py allocates the arrays that
 * it writes. No loop allocates memory, fails or keeps a state, so several threads may run one at
 * the same time. Arrays are C-contiguous. Sizes are in elements. */
#ifndef ROADEVAL_LOOPS_H
#define ROADEVAL_LOOPS_H

#include <stdbool.h>
#include <stdint.h>

/* LOOP marks a loop. If the system can choose at run time, the compiler makes several versions of
 * the loop: one without the vector instructions of newer processors, and others with them. */
#if defined(__GLIBC__) && defined(__x86_64__) && defined(__GNUC__) && __GNUC__ >= 12
#define LOOP __attribute__((target_clones("arch=x86-64-v4", "avx2", "default")))
#elif defined(__GLIBC__) && defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__)
#define LOOP __attribute__((target_clones("avx2", "default")))
#else
#define LOOP
#endif

/* PART marks a function that is always inlined, so it uses the vector instructions of its loop. */
#if defined(__GNUC__)
#define PART static inline __attribute__((always_inline))
#else
#define PART static inline
#endif

#if defined(_MSC_VER)
#define restrict __restrict
#endif

/* A run is a stretch of a row, [start, end), with its label: see `components` in plain.py. */
typedef struct {
    int32_t row, start, end, label;
} run_t;

/* A comment at the definition of each loop describes its parameters. */
#define RGB const uint8_t *red, const uint8_t *green, const uint8_t *blue

void look_up_sum_min(
    RGB, int64_t height, int64_t width, const uint8_t *table, uint8_t *codes, int64_t *histogram,
    int32_t *row);
void mahalanobis(
    RGB, int64_t height, int64_t width, const double *mean, const double *whitening,
    double greatest, float *distance, uint8_t *near);
void look_up_colours(
    RGB, int64_t height, int64_t width, const uint64_t *road,
    uint8_t *result, int32_t *words, uint8_t *bits);
void run_sums(RGB, int64_t width, const run_t *runs, int64_t count, int64_t *sums);
void ring_sums(
    RGB, int64_t height, int64_t width, const run_t *runs, const int64_t *first,
    const uint64_t *ring, int64_t words, int64_t reach, int64_t *sums, int64_t *reached,
    int64_t *merge);
void transfer(
    uint8_t *image, int64_t width, const run_t *runs, int64_t run_count, const double *source,
    const double *target, const double *gain, int64_t count, int64_t *pixels, uint8_t *tables);
int64_t components(
    const uint64_t *bits, int64_t height, int64_t width, int corner, int64_t *rows,
    int32_t *starts, int32_t *ends, int64_t *parents, run_t *runs);
void keep_region(
    const uint64_t *bits, int64_t height, int64_t width, int64_t *rows,
    int32_t *starts, int32_t *ends, int64_t *parents, int64_t *votes, uint64_t *kept);
void fill_holes(
    const uint64_t *bits, int64_t height, int64_t width, int64_t *rows, int32_t *starts,
    int32_t *ends, int64_t *parents, uint8_t *outside, uint64_t *filled);
void count_bits(
    const uint64_t *masks, int64_t mask_count, const uint64_t *classes, int64_t class_count,
    const uint64_t *regions, int64_t region_count, int64_t words, int64_t *counts,
    uint64_t *both);
void dilate(
    const uint64_t *bits, int64_t height, int64_t width, const int64_t *reach, int64_t reaches,
    uint64_t *room, uint64_t *result);
void erode(
    const uint64_t *bits, int64_t height, int64_t width, const int64_t *reach, int64_t reaches,
    uint64_t *room, uint64_t *result);
void geodesics(
    const uint16_t *cost, const uint8_t *seeds, int64_t height, int64_t width, int64_t rounds,
    int32_t *distance);
void tree_sum(
    const float *features, int64_t count, int64_t pixels, const int32_t *feature,
    const float *threshold, const uint32_t *kept, const float *values, int64_t trees,
    int64_t nodes, float *block, float *result);
void filter_rows(
    const uint8_t *rows, int64_t height, int64_t size, int64_t step, uint8_t *lines);
void label_rows(
    const uint8_t *labels, int64_t height, int64_t width, int bits, uint8_t *lines);

PART int64_t least(int64_t a, int64_t b) { return a < b ? a : b; }
PART int64_t most(int64_t a, int64_t b) { return a > b ? a : b; }

/* Return the number of set bits of a word. */
PART int64_t ones(uint64_t word) {
#if defined(__GNUC__)
    return __builtin_popcountll(word);
#else
    int64_t count = 0;
    for (; word; word &= word - 1)
        count++;
    return count;
#endif
}

/* Return the place of the lowest set bit of a word; at least one bit must be set. */
PART int64_t lowest(uint64_t word) {
#if defined(__GNUC__)
    return __builtin_ctzll(word);
#else
    return ones((word & (~word + 1)) - 1);
#endif
}

#endif
