/* x86_alu.h - arithmetic with flags, done by the processor itself. License: Apache-2.0.
 *
 * Each function takes operands of `size` bytes and the flags before, and leaves the flags after.
 * Compile with -mno-red-zone: the flags travel over the stack.
 */
#ifndef VBUS_EXEC_X86_ALU_H
#define VBUS_EXEC_X86_ALU_H

#include "x86_decode.h"

#define ARITHMETIC 0x8D5u /* OF SF ZF AF PF CF */

#define RUN_BINARY(op, type, constraint)                                                           \
    {                                                                                              \
        type left = (type)a, right = (type)b;                                                      \
        __asm__ volatile("push %[f]\n\tpopf\n\t" op " %[b], %[a]\n\tpushf\n\tpop %[f]"             \
                         : [a] "+" constraint(left), [f] "+r"(bits)                                \
                         : [b] constraint(right)                                                   \
                         : "cc", "memory");                                                        \
        result = left;                                                                             \
    }

#define RUN_UNARY(op, type, constraint)                                                            \
    {                                                                                              \
        type left = (type)a;                                                                       \
        __asm__ volatile("push %[f]\n\tpopf\n\t" op " %[a]\n\tpushf\n\tpop %[f]"                   \
                         : [a] "+" constraint(left), [f] "+r"(bits)                                \
                         :                                                                         \
                         : "cc", "memory");                                                        \
        result = left;                                                                             \
    }

#define RUN_SHIFT(op, type, constraint)                                                            \
    {                                                                                              \
        type left = (type)a;                                                                       \
        __asm__ volatile("push %[f]\n\tpopf\n\t" op " %%cl, %[a]\n\tpushf\n\tpop %[f]"             \
                         : [a] "+" constraint(left), [f] "+r"(bits)                                \
                         : "c"((unsigned char)b)                                                   \
                         : "cc", "memory");                                                        \
        result = left;                                                                             \
    }

#if defined(__x86_64__)
#define CASE_8(run, op) case 8: run(op "q", uint64_t, "r") break;
#define CASE_8_SHIFT_IN(op) case 8: RUN_SHIFT_IN(op "q", uint64_t) break;
#else
#define CASE_8(run, op)
#define CASE_8_SHIFT_IN(op)
#endif

#define FUNCTION(name, run, op)                                                                    \
    static inline word name(word a, word b, unsigned size, word *flags)                                   \
    {                                                                                              \
        word bits = (*flags & ARITHMETIC) | 0x202, result = 0;                                     \
                                                                                                   \
        (void)b;                                                                                   \
        switch (size) {                                                                            \
        case 1: run(op "b", uint8_t, "q") break;                                                   \
        case 2: run(op "w", uint16_t, "r") break;                                                  \
        case 4: run(op "l", uint32_t, "r") break;                                                  \
            CASE_8(run, op)                                                                        \
        }                                                                                          \
        *flags = (*flags & ~(word)ARITHMETIC) | (bits & ARITHMETIC);                               \
        return result;                                                                             \
    }

#define RUN_SHIFT_IN(op, type)                                                                     \
    {                                                                                              \
        type left = (type)a, right = (type)b;                                                      \
        __asm__ volatile("push %[f]\n\tpopf\n\t" op " %%cl, %[b], %[a]\n\tpushf\n\tpop %[f]"       \
                         : [a] "+r"(left), [f] "+r"(bits)                                          \
                         : [b] "r"(right), "c"((unsigned char)count)                               \
                         : "cc", "memory");                                                        \
        result = left;                                                                             \
    }

/* Operands of 2 bytes and more only. */
#define SHIFT_IN_FUNCTION(name, op)                                                                \
    static inline word name(word a, word b, word count, unsigned size, word *flags)                \
    {                                                                                              \
        word bits = (*flags & ARITHMETIC) | 0x202, result = 0;                                     \
                                                                                                   \
        switch (size) {                                                                            \
        case 2: RUN_SHIFT_IN(op "w", uint16_t) break;                                              \
        case 4: RUN_SHIFT_IN(op "l", uint32_t) break;                                              \
            CASE_8_SHIFT_IN(op)                                                                    \
        }                                                                                          \
        *flags = (*flags & ~(word)ARITHMETIC) | (bits & ARITHMETIC);                               \
        return result;                                                                             \
    }

#define WIDE_FUNCTION(name, op)                                                                    \
    static inline word name(word a, word b, unsigned size, word *flags)                                   \
    {                                                                                              \
        word bits = (*flags & ARITHMETIC) | 0x202, result = 0;                                     \
                                                                                                   \
        switch (size) {                                                                            \
        case 2: RUN_BINARY(op "w", uint16_t, "r") break;                                           \
        case 4: RUN_BINARY(op "l", uint32_t, "r") break;                                           \
            CASE_8(RUN_BINARY, op)                                                                 \
        }                                                                                          \
        *flags = (*flags & ~(word)ARITHMETIC) | (bits & ARITHMETIC);                               \
        return result;                                                                             \
    }

FUNCTION(alu_add, RUN_BINARY, "add")
FUNCTION(alu_or, RUN_BINARY, "or")
FUNCTION(alu_adc, RUN_BINARY, "adc")
FUNCTION(alu_sbb, RUN_BINARY, "sbb")
FUNCTION(alu_and, RUN_BINARY, "and")
FUNCTION(alu_sub, RUN_BINARY, "sub")
FUNCTION(alu_xor, RUN_BINARY, "xor")
FUNCTION(alu_cmp, RUN_BINARY, "cmp")
FUNCTION(alu_test, RUN_BINARY, "test")
FUNCTION(alu_inc, RUN_UNARY, "inc")
FUNCTION(alu_dec, RUN_UNARY, "dec")
FUNCTION(alu_neg, RUN_UNARY, "neg")
FUNCTION(alu_rol, RUN_SHIFT, "rol")
FUNCTION(alu_ror, RUN_SHIFT, "ror")
FUNCTION(alu_rcl, RUN_SHIFT, "rcl")
FUNCTION(alu_rcr, RUN_SHIFT, "rcr")
FUNCTION(alu_shl, RUN_SHIFT, "shl")
FUNCTION(alu_shr, RUN_SHIFT, "shr")
FUNCTION(alu_sar, RUN_SHIFT, "sar")
WIDE_FUNCTION(alu_imul, "imul")
WIDE_FUNCTION(alu_bt, "bt")
WIDE_FUNCTION(alu_bts, "bts")
WIDE_FUNCTION(alu_btr, "btr")
WIDE_FUNCTION(alu_btc, "btc")
WIDE_FUNCTION(alu_bsf, "bsf")
WIDE_FUNCTION(alu_bsr, "bsr")
WIDE_FUNCTION(alu_popcnt, "popcnt")
WIDE_FUNCTION(alu_tzcnt, "rep bsf")
WIDE_FUNCTION(alu_lzcnt, "rep bsr")
SHIFT_IN_FUNCTION(alu_shld, "shld")
SHIFT_IN_FUNCTION(alu_shrd, "shrd")

typedef word alu(word a, word b, unsigned size, word *flags);

static alu *const alu_group[8] = {alu_add, alu_or, alu_adc, alu_sbb,
                                  alu_and, alu_sub, alu_xor, alu_cmp};
static alu *const shift_group[8] = {alu_rol, alu_ror, alu_rcl, alu_rcr,
                                    alu_shl, alu_shr, alu_shl, alu_sar};
static alu *const bit_group[4] = {alu_bt, alu_bts, alu_btr, alu_btc};

#endif
