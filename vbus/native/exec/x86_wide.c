/* x86_wide.c - moves between memory and the vector and x87 registers. License: Apache-2.0. */
#include "x86_decode.h"

#define HALF 16u
#define STATE_AVX 4u

/* --- SSE and AVX ------------------------------------------------------------------------------ */

/* The upper half of a 32-byte register; the processor may have told that all of them are zero. */
static unsigned char *upper_half(struct decoder *d, unsigned number)
{
    struct x86 *cpu = d->cpu;

    if (!(*cpu->state & STATE_AVX)) {
        memset(cpu->ymm, 0, X86_REGISTERS * HALF);
        *cpu->state |= STATE_AVX;
    }
    return cpu->ymm[number];
}

static int take(struct decoder *d, unsigned size, unsigned place, int keeps_rest)
{
    unsigned char *reg = d->cpu->xmm[d->reg];
    unsigned char bytes[HALF];

    load_bytes(d, d->address, bytes, size < HALF ? size : HALF);
    if (d->vex && keeps_rest)
        memcpy(reg, d->cpu->xmm[d->other], HALF);
    memcpy(reg + place, bytes, size < HALF ? size : HALF);
    if (!keeps_rest && size < HALF)
        memset(reg + size, 0, HALF - size);
    if (size > HALF)
        load_bytes(d, d->address + HALF, upper_half(d, d->reg), HALF);
    else if (d->vex)
        memset(upper_half(d, d->reg), 0, HALF);
    return X86_DONE;
}

static int give(struct decoder *d, unsigned size, unsigned place)
{
    store_bytes(d, d->address, d->cpu->xmm[d->reg] + place, size < HALF ? size : HALF);
    if (size > HALF)
        store_bytes(d, d->address + HALF, upper_half(d, d->reg), HALF);
    return X86_DONE;
}

int wide_vector(struct decoder *d, unsigned op)
{
    unsigned size = HALF, place = 0;
    int stores = 0, keeps_rest = 0, scalar = 0;

    operands(d);
    settle_address(d, 0);
    switch (op) {
    case 0x10: /* movups movupd movss movsd */
    case 0x11:
        scalar = d->repeat != 0;
        size = d->repeat == 0xF3 ? 4 : d->repeat == 0xF2 ? 8 : HALF;
        stores = op == 0x11;
        break;
    case 0x12: /* movlps movlpd */
    case 0x13:
    case 0x16: /* movhps movhpd */
    case 0x17:
        if (d->repeat)
            return X86_UNKNOWN;
        size = 8;
        place = op & 4 ? 8 : 0;
        keeps_rest = 1;
        stores = op & 1;
        break;
    case 0x28: /* movaps movapd */
    case 0x29:
    case 0x2B: /* movntps movntpd */
        stores = op != 0x28;
        break;
    case 0x6E: /* movd movq */
        if (!d->operand16)
            return X86_UNKNOWN;
        size = d->rex & REX_W ? 8 : 4;
        break;
    case 0x7E:
        if (d->repeat == 0xF3) {
            size = 8;
        } else if (d->operand16) {
            size = d->rex & REX_W ? 8 : 4;
            stores = 1;
        } else {
            return X86_UNKNOWN;
        }
        break;
    case 0x6F: /* movdqa movdqu */
    case 0x7F:
        if (!d->operand16 && d->repeat != 0xF3)
            return X86_UNKNOWN;
        stores = op == 0x7F;
        break;
    case 0xD6: /* movq */
        if (!d->operand16)
            return X86_UNKNOWN;
        size = 8;
        stores = 1;
        break;
    case 0xE7: /* movntdq */
        if (!d->operand16)
            return X86_UNKNOWN;
        stores = 1;
        break;
    case 0xF0: /* lddqu */
        if (d->repeat != 0xF2)
            return X86_UNKNOWN;
        break;
    case WIDE_MOVNTDQA:
        if (!d->operand16)
            return X86_UNKNOWN;
        break;
    default:
        return X86_UNKNOWN;
    }
    if (d->wide && size == HALF)
        size = 2 * HALF;
    else if (d->wide && !scalar)
        return X86_UNKNOWN;
    if (!in_window(d, size))
        return X86_FOREIGN;
    if (d->cpu->xmm == NULL || (d->vex && d->cpu->ymm == NULL))
        return X86_UNKNOWN;
    return stores ? give(d, size, place) : take(d, size, place, keeps_rest);
}

int wide_avx(struct decoder *d, unsigned op)
{
    unsigned first = *d->next++, last = first, map = 1;

    if (X86_BITS == 32 && first < 0xC0)
        return X86_UNKNOWN; /* les and lds */
    d->rex = first & 0x80 ? 0 : REX_R;
    if (op == 0xC4) {
        map = first & 31;
        last = *d->next++;
        d->rex |= (first & 0x40 ? 0 : REX_X) | (first & 0x20 ? 0 : REX_B) | (last & 0x80 ? REX_W : 0);
    }
    d->vex = 1;
    d->wide = last >> 2 & 1;
    d->other = (~last >> 3 & 15) % X86_REGISTERS;
    d->operand16 = (last & 3) == 1;
    d->repeat = (last & 3) == 2 ? 0xF3 : (last & 3) == 3 ? 0xF2 : 0;
    op = *d->next++;
    if (map == 1)
        return wide_vector(d, op);
    return map == 2 && op == 0x2A ? wide_vector(d, WIDE_MOVNTDQA) : X86_UNKNOWN;
}

/* --- x87 -------------------------------------------------------------------------------------- */

/* Each instruction D8h to DFh, by the three bits of its ModRM byte, on memory at DI; between them the
 * program's registers are the processor's. */
#if X86_BITS == 64
#define TAKE "fxrstor64 (%rsi)"
#define GIVE "fxsave64 (%rsi)"
#define TAKE_OWN "fxrstor64 (%[own])"
#define GIVE_OWN "fxsave64 (%[own])"
#define SPACE 512
#define CONTROL 0
#define STATUS 2
#else
#define TAKE "frstor (%esi)"
#define GIVE "fnsave (%esi)"
#define TAKE_OWN "frstor (%[own])"
#define GIVE_OWN "fnsave (%[own])"
#define SPACE 108
#define CONTROL 0
#define STATUS 4
#endif

__asm__(".pushsection .text\n"
        ".balign 16\n"
        "vbus_x87_steps:\n"
        ".set vbus_x87_turn, 0\n"
        ".rept 64\n"
        ".balign 16\n" TAKE "\n"
        ".byte 0xD8 + (vbus_x87_turn >> 3), (vbus_x87_turn & 7) << 3 | 7\n" GIVE "\n"
        "ret\n"
        ".set vbus_x87_turn, vbus_x87_turn + 1\n"
        ".endr\n"
        ".popsection\n");
extern const unsigned char vbus_x87_steps[] __attribute__((visibility("hidden")));

/* Bytes read, or if negative written; 0: none, or the registers as a whole (fldenv, fsave ...). */
static const signed char x87_sizes[64] = {
    4, 4, 4,  4,  4,  4,  4,   4,  /* D8: arithmetic, m32 */
    4, 0, -4, -4, 0,  2,  0,   -2, /* D9: fld fst fstp fldcw fnstcw */
    4, 4, 4,  4,  4,  4,  4,   4,  /* DA: arithmetic, m32 as integer */
    4, -4, -4, -4, 0, 10, 0,   -10, /* DB: fild fisttp fist fistp, fld fstp m80 */
    8, 8, 8,  8,  8,  8,  8,   8,  /* DC: arithmetic, m64 */
    8, -8, -8, -8, 0, 0,  0,   -2, /* DD: fld fisttp fst fstp fnstsw */
    2, 2, 2,  2,  2,  2,  2,   2,  /* DE: arithmetic, m16 as integer */
    2, -2, -2, -2, 10, 8, -10, -8, /* DF: fild fisttp fist fistp fbld fild fbstp fistp */
};

/* Exceptions after which a store has not happened: invalid, overflow, underflow. */
#define PREVENT 0x19u

int wide_x87(struct decoder *d, unsigned op)
{
    unsigned which, size;
    unsigned char data[16] = {0}, *state = d->cpu->fpu;
    unsigned char own[SPACE] __attribute__((aligned(16)));
    const unsigned char *step;

    operands(d);
    settle_address(d, 0);
    which = (op & 7) << 3 | (d->reg & 7);
    size = (unsigned)(x87_sizes[which] < 0 ? -x87_sizes[which] : x87_sizes[which]);
    if (!in_window(d, size ? size : 1))
        return X86_FOREIGN;
    if (size == 0 || state == NULL)
        return X86_UNKNOWN;
    if (x87_sizes[which] > 0)
        load_bytes(d, d->address, data, size);
    step = vbus_x87_steps + 16 * which;
    __asm__ volatile(GIVE_OWN "\n\tcall *%[step]\n\t" TAKE_OWN
                     :
                     : [own] "r"(own), [step] "r"(step), "D"(data), "S"(state)
                     : "memory", "cc");
    if (x87_sizes[which] < 0 && !(state[STATUS] & ~state[CONTROL] & PREVENT))
        store_bytes(d, d->address, data, size);
    return X86_DONE;
}

/* --- names, for messages ---------------------------------------------------------------------- */

static int is_vector(unsigned op)
{
    return (op >= 0x10 && op < 0x18) || (op >= 0x28 && op < 0x30) || (op >= 0x50 && op < 0x80)
           || op == 0xC2 || op == 0xC4 || op == 0xC6 || (op >= 0xD0 && op != 0xFF);
}

const char *x86_kind(uintptr_t ip)
{
    const unsigned char *next = (const unsigned char *)ip;
    unsigned which;

    while (*next == 0x66 || *next == 0xF2 || *next == 0xF3 || *next == 0xF0 || *next == 0x67
           || *next == 0x2E || *next == 0x36 || *next == 0x3E || *next == 0x26)
        next++;
    if (*next == 0x64 || *next == 0x65)
        return "an instruction with a segment register";
    if (X86_BITS == 32 && *next == 0x67)
        return "an instruction with a 16-bit address";
    if (X86_BITS == 64 && (*next & 0xF0) == 0x40)
        next++;
    if (*next == 0x62 && (X86_BITS == 64 || next[1] >= 0xC0))
        return "an AVX-512 instruction";
    if ((*next == 0xC4 || *next == 0xC5) && (X86_BITS == 64 || next[1] >= 0xC0))
        return "an AVX or BMI instruction that is no plain move";
    if (*next >= 0xD8 && *next <= 0xDF)
        return "an instruction that moves the whole x87 state";
    which = next[1] >> 3 & 7;
    if (*next == 0xFF && (which == 2 || which == 3))
        return "a call through a pointer in the card";
    if (*next == 0xFF && (which == 4 || which == 5))
        return "a jump through a pointer in the card";
    if (*next == 0x0F && (next[1] == 0x38 || next[1] == 0x3A || is_vector(next[1])))
        return "an SSE or MMX instruction that is no plain move";
    if (*next == 0x0F && next[1] == 0xAE)
        return "an instruction that moves or flushes more than a card has";
    return "an instruction of an unusual kind";
}
