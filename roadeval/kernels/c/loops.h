/* What all loops share.
 *
 * The functions are called by roadeval/kernels/compiled.py, which states what each takes, checks
 * every array, and allocates what they write: nothing here allocates, fails or keeps anything, so
 * that any number of threads may run them. Their definition is the function of the same name in
 * roadeval/kernels/plain.py, bit for bit. Arrays are C-contiguous; sizes are in elements.
 */
#ifndef ROADEVAL_LOOPS_H
#define ROADEVAL_LOOPS_H

#include <stdbool.h>
#include <stdint.h>

/* A loop that the library exports. Where it can choose at run time, the compiler makes several of
 * it, with the vector instructions of newer processors and without. */
#if defined(_WIN32)
#define LOOP __declspec(dllexport)
#elif defined(__GLIBC__) && defined(__x86_64__) && defined(__GNUC__) && __GNUC__ >= 12
#define LOOP __attribute__((target_clones("arch=x86-64-v4", "avx2", "default")))
#elif defined(__GLIBC__) && defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__)
#define LOOP __attribute__((target_clones("avx2", "default")))
#else
#define LOOP
#endif

/* A part of a loop, always within it: its code follows the loop's instructions. */
#if defined(__GNUC__)
#define PART static inline __attribute__((always_inline))
#else
#define PART static inline
#endif

#if defined(_MSC_VER)
#define restrict __restrict
#endif

typedef struct {
    const uint8_t *red, *green, *blue;
} planes_t;

/* A run is a stretch of a row, [start, end), with its label: see `components` in plain.py. */
typedef struct {
    int32_t row, start, end, label;
} run_t;

PART int64_t least(int64_t a, int64_t b) { return a < b ? a : b; }
PART int64_t most(int64_t a, int64_t b) { return a > b ? a : b; }

/* The number of set bits of a word. */
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

/* The place of the lowest set bit of a word that has one. */
PART int64_t lowest(uint64_t word) {
#if defined(__GNUC__)
    return __builtin_ctzll(word);
#else
    return ones((word & (~word + 1)) - 1);
#endif
}

#endif
