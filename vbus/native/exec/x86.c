/* x86.c - see x86.h. License: Apache-2.0. */
#include "x86.h"

#include "x86_alu.h"
#include "x86_decode.h"

#include <string.h>

/* --- string instructions ---------------------------------------------------------------------- */

static void advance(struct decoder *d, unsigned number, unsigned size)
{
    word step = d->flags & DIRECTION ? -(word)size : size;

    set(d, number, (d->cpu->regs[number] + step) & MASK(d->address_size), d->address_size);
}

/* One element; whether a repeated comparison goes on is in the flags. */
static void string_element(struct decoder *d, unsigned op, unsigned size)
{
    word mask = MASK(d->address_size);
    word from = d->cpu->regs[X86_SI] & mask, to = d->cpu->regs[X86_DI] & mask;
    word value;

    switch (op & ~1u) {
    case 0x6C: /* ins */
        store(d, to, d->bus->in((unsigned)get(d, X86_DX, 2), size), size);
        advance(d, X86_DI, size);
        break;
    case 0x6E: /* outs */
        d->bus->out((unsigned)get(d, X86_DX, 2), (uint32_t)load(d, from, size), size);
        advance(d, X86_SI, size);
        break;
    case 0xA4: /* movs */
        store(d, to, load(d, from, size), size);
        advance(d, X86_SI, size);
        advance(d, X86_DI, size);
        break;
    case 0xA6: /* cmps */
        value = load(d, from, size);
        alu_cmp(value, load(d, to, size), size, &d->flags);
        advance(d, X86_SI, size);
        advance(d, X86_DI, size);
        break;
    case 0xAA: /* stos */
        store(d, to, get(d, X86_AX, size), size);
        advance(d, X86_DI, size);
        break;
    case 0xAC: /* lods */
        set(d, X86_AX, load(d, from, size), size);
        advance(d, X86_SI, size);
        break;
    default: /* scas */
        alu_cmp(get(d, X86_AX, size), load(d, to, size), size, &d->flags);
        advance(d, X86_DI, size);
    }
}

static int string(struct decoder *d, unsigned op)
{
    unsigned size = op & 1 ? d->size : 1;
    int ports = op < 0x70, compares = (op & ~1u) == 0xA6 || (op & ~1u) == 0xAE;
    word count = 1;

    if (ports && size == 8)
        size = 4;
    if (d->segment || (ports && !d->bus->may((unsigned)get(d, X86_DX, 2), size)))
        return X86_FOREIGN;
    if (d->repeat)
        count = d->cpu->regs[X86_CX] & MASK(d->address_size);
    while (count > 0) {
        string_element(d, op, size);
        count--;
        if (compares && d->repeat && !(d->flags & ZERO) == (d->repeat == 0xF3))
            break;
    }
    if (d->repeat)
        set(d, X86_CX, count, d->address_size);
    return X86_DONE;
}

/* --- ports ------------------------------------------------------------------------------------ */

static int port(struct decoder *d, unsigned op)
{
    unsigned size = !(op & 1) ? 1 : d->operand16 ? 2 : 4;
    unsigned number = op < 0xE8 ? *d->next++ : (unsigned)get(d, X86_DX, 2);

    if (!d->bus->may(number, size))
        return X86_FOREIGN;
    if (op & 2)
        d->bus->out(number, (uint32_t)get(d, X86_AX, size), size);
    else
        set(d, X86_AX, d->bus->in(number, size), size);
    return X86_DONE;
}

/* --- one-byte opcodes ------------------------------------------------------------------------- */

static int arithmetic(struct decoder *d, unsigned op)
{
    unsigned size = op & 1 ? d->size : 1, which = op >> 3 & 7;
    word result;

    operands(d);
    settle_address(d, 0);
    if (!in_window(d, size))
        return X86_FOREIGN;
    if (op & 2) {
        result = alu_group[which](get(d, d->reg, size), get_rm(d, size), size, &d->flags);
        if (which != 7)
            set(d, d->reg, result, size);
    } else {
        result = alu_group[which](get_rm(d, size), get(d, d->reg, size), size, &d->flags);
        if (which != 7)
            set_rm(d, result, size);
    }
    return X86_DONE;
}

static int arithmetic_immediate(struct decoder *d, unsigned op)
{
    unsigned size = op & 1 ? d->size : 1;
    unsigned bytes = op == 0x81 ? immediate_size(d) : 1;
    word value, result;

    operands(d);
    settle_address(d, bytes);
    if (!in_window(d, size))
        return X86_FOREIGN;
    value = immediate(d, bytes);
    result = alu_group[d->reg & 7](get_rm(d, size), value, size, &d->flags);
    if ((d->reg & 7) != 7)
        set_rm(d, result, size);
    return X86_DONE;
}

static int multiply_immediate(struct decoder *d, unsigned op)
{
    unsigned bytes = op == 0x69 ? immediate_size(d) : 1;
    word value;

    operands(d);
    settle_address(d, bytes);
    if (!in_window(d, d->size))
        return X86_FOREIGN;
    value = immediate(d, bytes);
    set(d, d->reg, alu_imul(get_rm(d, d->size), value, d->size, &d->flags), d->size);
    return X86_DONE;
}

/* test, xchg, mov with a register */
static int move(struct decoder *d, unsigned op)
{
    unsigned size = op & 1 ? d->size : 1;
    word value;

    operands(d);
    settle_address(d, 0);
    if (!in_window(d, size))
        return X86_FOREIGN;
    switch (op & ~1u) {
    case 0x84:
        alu_test(get_rm(d, size), get(d, d->reg, size), size, &d->flags);
        break;
    case 0x86:
        value = get_rm(d, size);
        set_rm(d, get(d, d->reg, size), size);
        set(d, d->reg, value, size);
        break;
    case 0x88:
        set_rm(d, get(d, d->reg, size), size);
        break;
    default:
        set(d, d->reg, get_rm(d, size), size);
    }
    return X86_DONE;
}

static int move_immediate(struct decoder *d, unsigned op)
{
    unsigned size = op & 1 ? d->size : 1, bytes = op & 1 ? immediate_size(d) : 1;

    operands(d);
    settle_address(d, bytes);
    if (!in_window(d, size))
        return X86_FOREIGN;
    if ((d->reg & 7) != 0)
        return X86_UNKNOWN;
    set_rm(d, immediate(d, bytes), size);
    return X86_DONE;
}

/* mov between the accumulator and an address that stands in the instruction */
static int move_absolute(struct decoder *d, unsigned op)
{
    unsigned size = op & 1 ? d->size : 1;
    word address = 0;

    memcpy(&address, d->next, d->address_size);
    d->next += d->address_size;
    if (!d->bus->follows && !d->bus->covers(address, size))
        return X86_FOREIGN;
    if (op & 2)
        store(d, address, get(d, X86_AX, size), size);
    else
        set(d, X86_AX, load(d, address, size), size);
    return X86_DONE;
}

static int shift(struct decoder *d, unsigned op)
{
    unsigned size = op & 1 ? d->size : 1, bytes = op < 0xD0;
    word count, value;

    operands(d);
    settle_address(d, bytes);
    if (!in_window(d, size))
        return X86_FOREIGN;
    count = bytes ? *d->next++ : op < 0xD2 ? 1 : get(d, X86_CX, 4) & 0xFF;
    value = get_rm(d, size);
    set_rm(d, shift_group[d->reg & 7](value, count, size, &d->flags), size);
    return X86_DONE;
}

/*
 * mul, imul, div and idiv: what they do to the accumulator pair, the processor does itself. `op` and
 * `signed_op` are names of instructions without the letter of their size.
 */
#define ACCUMULATE(op, type)                                                                       \
    {                                                                                              \
        type operand = (type)value;                                                                \
        __asm__ volatile("push %[f]\n\tpopf\n\t" op " %[v]\n\tpushf\n\tpop %[f]"                   \
                         : "+a"(low), "+d"(high), [f] "+r"(bits)                                   \
                         : [v] "q"(operand)                                                        \
                         : "cc", "memory");                                                        \
    }
#define EITHER(op, signed_op, suffix, type)                                                        \
    if (with_sign)                                                                                 \
        ACCUMULATE(signed_op suffix, type)                                                         \
    else                                                                                           \
        ACCUMULATE(op suffix, type)
#if X86_BITS == 64
#define EIGHT_BYTES(op, signed_op) case 8: EITHER(op, signed_op, "q", uint64_t) break;
#else
#define EIGHT_BYTES(op, signed_op)
#endif
#define OF_ANY_SIZE(op, signed_op)                                                                 \
    switch (size) {                                                                                \
    case 1: EITHER(op, signed_op, "b", uint8_t) break;                                             \
    case 2: EITHER(op, signed_op, "w", uint16_t) break;                                            \
    case 4: EITHER(op, signed_op, "l", uint32_t) break;                                            \
    EIGHT_BYTES(op, signed_op)                                                                     \
    }

/* The accumulator pair and the flags as the processor left them. */
static void accumulated(struct decoder *d, word low, word high, word bits, unsigned size)
{
    d->flags = (d->flags & ~(word)ARITHMETIC) | (bits & ARITHMETIC);
    if (size == 1) {
        set(d, X86_AX, low, 2);
    } else {
        set(d, X86_AX, low, size);
        set(d, X86_DX, high, size);
    }
}

/* mul and imul of the accumulator by what was read */
static void multiply(struct decoder *d, word value, unsigned size, int with_sign)
{
    word low = get(d, X86_AX, size), high = 0;
    word bits = (d->flags & ARITHMETIC) | 0x202;

    OF_ANY_SIZE("mul", "imul")
    accumulated(d, low, high, bits, size);
}

#if X86_BITS == 64
typedef __int128 wide;
typedef unsigned __int128 wide_natural;
#else
typedef int64_t wide;
typedef uint64_t wide_natural;
#endif

/* Whether the quotient of `high`:`low` by what was read can be had. */
static int divides(word low, word high, word value, unsigned size, int with_sign)
{
    unsigned bits = 8 * size;
    wide_natural whole;
    wide dividend, divisor, quotient, most;

    if ((value & MASK(size)) == 0)
        return 0;
    if (!with_sign)
        return (high & MASK(size)) < (value & MASK(size));
    whole = (wide_natural)(high & MASK(size)) << bits | (low & MASK(size));
    dividend = (wide)(whole << (8 * sizeof whole - 2 * bits)) >> (8 * sizeof whole - 2 * bits);
    divisor = (intptr_t)sign_extend(value, size);
    if (divisor == -1 && whole << (8 * sizeof whole - 2 * bits)
                             == (wide_natural)1 << (8 * sizeof whole - 1))
        return 0;
    quotient = dividend / divisor;
    most = (wide)1 << (bits - 1);
    return quotient >= -most && quotient < most;
}

/* div and idiv by what was read */
static int divide(struct decoder *d, word value, unsigned size, int with_sign)
{
    word low = get(d, X86_AX, size);
    word high = size == 1 ? get(d, X86_AX, 2) >> 8 : get(d, X86_DX, size);
    word bits = (d->flags & ARITHMETIC) | 0x202;

    if (!divides(low, high, value, size, with_sign))
        return X86_DIVISION;
    if (size == 1)
        low |= high << 8;
    OF_ANY_SIZE("div", "idiv")
    accumulated(d, low, high, bits, size);
    return X86_DONE;
}

static int unary(struct decoder *d, unsigned op)
{
    unsigned size = op & 1 ? d->size : 1, bytes;
    word value;

    operands(d);
    bytes = (d->reg & 7) > 1 ? 0 : op & 1 ? immediate_size(d) : 1;
    settle_address(d, bytes);
    if (!in_window(d, size))
        return X86_FOREIGN;
    switch (d->reg & 7) {
    case 2:
        set_rm(d, ~get_rm(d, size), size);
        return X86_DONE;
    case 3:
        set_rm(d, alu_neg(get_rm(d, size), 0, size, &d->flags), size);
        return X86_DONE;
    case 4:
    case 5:
        multiply(d, get_rm(d, size), size, (d->reg & 7) == 5);
        return X86_DONE;
    case 6:
    case 7:
        return divide(d, get_rm(d, size), size, (d->reg & 7) == 7);
    default:
        value = immediate(d, bytes);
        alu_test(get_rm(d, size), value, size, &d->flags);
        return X86_DONE;
    }
}

static int increment(struct decoder *d, unsigned op)
{
    unsigned size = op & 1 ? d->size : 1, which;
    word value;

    operands(d);
    settle_address(d, 0);
    which = d->reg & 7;
    if (op == 0xFF && which == 6 && X86_BITS == 64 && size == 4)
        size = 8;
    if (!in_window(d, size))
        return X86_FOREIGN;
    if (which < 2) {
        set_rm(d, (which ? alu_dec : alu_inc)(get_rm(d, size), 0, size, &d->flags), size);
        return X86_DONE;
    }
    if (op != 0xFF || which != 6)
        return X86_UNKNOWN; /* calls and jumps through the window */
    value = get_rm(d, size);
    store(d, d->cpu->regs[X86_SP] - size, value, size);
    d->cpu->regs[X86_SP] -= size;
    return X86_DONE;
}

static int pop(struct decoder *d)
{
    unsigned size = d->operand16 ? 2 : sizeof(word);
    word value = load(d, d->cpu->regs[X86_SP], size);

    d->cpu->regs[X86_SP] += size; /* an address that counts from SP counts from the new one */
    operands(d);
    settle_address(d, 0);
    if (!in_window(d, size)) {
        d->cpu->regs[X86_SP] -= size;
        return X86_FOREIGN;
    }
    store(d, d->address, value, size);
    return X86_DONE;
}

/* xlat: a byte of a table */
static int translate(struct decoder *d)
{
    word address = (d->cpu->regs[X86_BX] + get(d, X86_AX, 1)) & MASK(d->address_size);

    if (!d->bus->follows && !d->bus->covers(address, 1))
        return X86_FOREIGN;
    set(d, X86_AX, load(d, address, 1), 1);
    return X86_DONE;
}

static int one_byte(struct decoder *d, unsigned op)
{
    int result = d->bus->follows ? x86_follow(d, op) : X86_USUAL;

    if (result != X86_USUAL)
        return result;
    if (op < 0x40 && (op & 7) < 4)
        return arithmetic(d, op);
    switch (op) {
    case 0x0F:
        return x86_two_bytes(d);
#if X86_BITS == 64
    case 0x63: /* movslq */
        operands(d);
        settle_address(d, 0);
        if (!in_window(d, 4))
            return X86_FOREIGN;
        set(d, d->reg, sign_extend(get_rm(d, 4), 4), d->size);
        return X86_DONE;
#endif
    case 0x69: case 0x6B:
        return multiply_immediate(d, op);
    case 0x6C: case 0x6D: case 0x6E: case 0x6F:
    case 0xA4: case 0xA5: case 0xA6: case 0xA7:
    case 0xAA: case 0xAB: case 0xAC: case 0xAD: case 0xAE: case 0xAF:
        return string(d, op);
    case 0x80: case 0x81: case 0x83:
        return arithmetic_immediate(d, op);
    case 0x84: case 0x85: case 0x86: case 0x87: case 0x88: case 0x89: case 0x8A: case 0x8B:
        return move(d, op);
    case 0x8F:
        return pop(d);
    case 0xA0: case 0xA1: case 0xA2: case 0xA3:
        return move_absolute(d, op);
    case 0xC0: case 0xC1: case 0xD0: case 0xD1: case 0xD2: case 0xD3:
        return shift(d, op);
    case 0xC6: case 0xC7:
        return move_immediate(d, op);
    case 0xC4: case 0xC5:
        return wide_avx(d, op);
    case 0xD7:
        return translate(d);
    case 0xD8: case 0xD9: case 0xDA: case 0xDB: case 0xDC: case 0xDD: case 0xDE: case 0xDF:
        return wide_x87(d, op);
    case 0xE4: case 0xE5: case 0xE6: case 0xE7:
    case 0xEC: case 0xED: case 0xEE: case 0xEF:
        return port(d, op);
    case 0xF6: case 0xF7:
        return unary(d, op);
    case 0xFA: /* cli and sti: there is nothing to keep out */
    case 0xFB:
        return d->bus->may(0, 0) ? X86_DONE : X86_FOREIGN;
    case 0xFE: case 0xFF:
        return increment(d, op);
    default:
        return X86_UNKNOWN;
    }
}

int x86_step(struct x86 *cpu, const struct x86_bus *bus)
{
    struct decoder d;
    unsigned turn, op = 0;
    int result;

    memset(&d, 0, sizeof d);
    d.cpu = cpu;
    d.bus = bus;
    d.next = (const unsigned char *)cpu->ip;
    d.flags = cpu->flags;
    d.address_size = sizeof(word);
    for (turn = 0; turn < 15; turn++) {
        op = *d.next++;
        if (op == 0x66)
            d.operand16 = 1;
        else if (op == 0xF2 || op == 0xF3)
            d.repeat = (int)op;
        else if (op == 0x64 || op == 0x65)
            d.segment = op;
        else if (op == 0x67 && X86_BITS == 64)
            d.address_size = 4;
        else if (op == 0x67)
            return X86_UNKNOWN;
        else if (op == 0xF0 && bus->follows)
            return X86_UNKNOWN; /* other processes might see it as two */
        else if (op != 0xF0 && op != 0x2E && op != 0x36 && op != 0x3E && op != 0x26)
            break;
    }
    if (X86_BITS == 64 && (op & 0xF0) == 0x40) {
        d.rex = op;
        op = *d.next++;
    }
    d.size = d.rex & REX_W ? 8 : d.operand16 ? 2 : 4;
    if (d.segment && op != 0xE4 && op != 0xEC)
        return X86_UNKNOWN;
    result = one_byte(&d, op);
    if (result == X86_DONE) {
        cpu->ip = (word)d.next;
        cpu->flags = d.flags;
    }
    return result;
}
