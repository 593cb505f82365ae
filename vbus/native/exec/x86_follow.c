/* x86_follow.c - instructions that stand between two accesses of a loop. License: Apache-2.0.
 *
 * Only what loops around an access are made of: moves and arithmetic of registers and memory, the
 * stack, and jumps to places that the instruction itself names. Whatever leaves the program's own
 * text, may be seen half done by others, or needs more than integer registers is left to the
 * processor. Registers change when memory has been reached: an instruction whose memory is not there
 * has done nothing.
 */
#include "x86_alu.h"
#include "x86_decode.h"

static void push(struct decoder *d, word value)
{
    store(d, d->cpu->regs[X86_SP] - sizeof(word), value, sizeof(word));
    d->cpu->regs[X86_SP] -= sizeof(word);
}

static word pull(struct decoder *d)
{
    word value = load(d, d->cpu->regs[X86_SP], sizeof(word));

    d->cpu->regs[X86_SP] += sizeof(word);
    return value;
}

/* A jump of up to 4 bytes, if the condition holds. */
static int jump(struct decoder *d, unsigned size, int yes)
{
    word distance = immediate(d, size);

    if (yes)
        d->next += distance;
    return X86_DONE;
}

static int call(struct decoder *d)
{
    word distance = immediate(d, 4);

    push(d, (word)d->next);
    d->next += distance;
    return X86_DONE;
}

static int back(struct decoder *d, unsigned drop)
{
    d->next = (const unsigned char *)pull(d);
    d->cpu->regs[X86_SP] += drop;
    return X86_DONE;
}

static int leave(struct decoder *d)
{
    word value = load(d, d->cpu->regs[X86_BP], sizeof(word));

    d->cpu->regs[X86_SP] = d->cpu->regs[X86_BP] + sizeof(word);
    d->cpu->regs[X86_BP] = value;
    return X86_DONE;
}

/* add, or, adc, sbb, and, sub, xor, cmp and test of the accumulator and an immediate */
static int with_accumulator(struct decoder *d, alu *action, unsigned op, int keeps)
{
    unsigned size = op & 1 ? d->size : 1;
    word value = immediate(d, op & 1 ? immediate_size(d) : 1);
    word result = action(get(d, X86_AX, size), value, size, &d->flags);

    if (keeps)
        set(d, X86_AX, result, size);
    return X86_DONE;
}

static int move_immediate(struct decoder *d, unsigned op)
{
    unsigned size = op < 0xB8 ? 1 : d->size, number = (op & 7) | (d->rex & REX_B ? 8 : 0);
    word value = 0;

    memcpy(&value, d->next, size);
    d->next += size;
    set(d, number, value, size);
    return X86_DONE;
}

static int load_address(struct decoder *d)
{
    operands(d);
    settle_address(d, 0);
    if (!d->has_address)
        return X86_UNKNOWN;
    set(d, d->reg, d->address, d->size);
    return X86_DONE;
}

/* cbw, cwde, cdqe; cwd, cdq, cqo */
static int widen(struct decoder *d, unsigned op)
{
    word value = sign_extend(get(d, X86_AX, d->size), d->size);

    if (op == 0x98)
        set(d, X86_AX, sign_extend(get(d, X86_AX, d->size / 2), d->size / 2), d->size);
    else
        set(d, X86_DX, (word)((intptr_t)value >> (8 * sizeof(word) - 1)), d->size);
    return X86_DONE;
}

/* A no-operation with operands, and the mark of a place that may be jumped to. */
static int nothing(struct decoder *d, unsigned op)
{
    d->next++;
    if (op == 0x1E) {
        if (d->repeat != 0xF3 || (*d->next & 0xFE) != 0xFA)
            return X86_UNKNOWN;
        d->next++;
        return X86_DONE;
    }
    operands(d);
    return X86_DONE;
}

static int two_bytes(struct decoder *d)
{
    unsigned op = *d->next;

    if (op >= 0x80 && op < 0x90) {
        d->next++;
        return d->operand16 ? X86_UNKNOWN : jump(d, 4, x86_condition(d->flags, op & 15));
    }
    if ((op >= 0x40 && op < 0x50) || (op >= 0x90 && op < 0xA0))
        return X86_USUAL; /* moves, and bytes set, on a condition */
    switch (op) {
    case 0x1E: case 0x1F:
        return nothing(d, op);
    case 0xA3: case 0xBA: /* tests of bits */
    case 0xAF: case 0xB6: case 0xB7: case 0xBE: case 0xBF:
        return X86_USUAL;
    default:
        return X86_UNKNOWN;
    }
}

int x86_follow(struct decoder *d, unsigned op)
{
    unsigned number = (op & 7) | (d->rex & REX_B ? 8 : 0);

    if (op == 0x0F)
        return two_bytes(d);
    if (d->repeat && op != 0x90 && op != 0xC3)
        return X86_UNKNOWN;
    if (op < 0x40 && (op & 7) < 6)
        return (op & 7) < 4 ? X86_USUAL
                            : with_accumulator(d, alu_group[op >> 3], op, op >> 3 != 7);
    if (X86_BITS == 32 && op >= 0x40 && op < 0x50) {
        set(d, number, (op < 0x48 ? alu_inc : alu_dec)(get(d, number, d->size), 0, d->size,
                                                      &d->flags), d->size);
        return X86_DONE;
    }
    if (d->operand16 && ((op >= 0x50 && op < 0x80) || (op >= 0xC2 && op < 0xEC)))
        return op == 0x69 || op == 0x6B || op == 0xC7 ? X86_USUAL : X86_UNKNOWN;
    if (op >= 0x50 && op < 0x58) {
        push(d, d->cpu->regs[number]);
        return X86_DONE;
    }
    if (op >= 0x58 && op < 0x60) {
        word value = pull(d);

        d->cpu->regs[number] = value;
        return X86_DONE;
    }
    if (op >= 0x70 && op < 0x80)
        return jump(d, 1, x86_condition(d->flags, op & 15));
    if (op >= 0xB0 && op < 0xC0)
        return move_immediate(d, op);
    switch (op) {
    case 0x63: case 0x69: case 0x6B:
    case 0x80: case 0x81: case 0x83: case 0x84: case 0x85:
    case 0x88: case 0x89: case 0x8A: case 0x8B:
    case 0xA0: case 0xA1: case 0xA2: case 0xA3:
    case 0xC6: case 0xC7:
    case 0xE4: case 0xE5: case 0xE6: case 0xE7: case 0xEC: case 0xED: case 0xEE: case 0xEF:
    case 0xF6: case 0xF7: case 0xFA: case 0xFB: case 0xFE: case 0xFF:
        return X86_USUAL;
    case 0xC0: case 0xC1: case 0xD0: case 0xD1: case 0xD2: case 0xD3:
        return *d->next & 0x20 ? X86_USUAL : X86_UNKNOWN; /* rotations leave flags undefined */
    case 0x68: case 0x6A:
        push(d, immediate(d, op == 0x68 ? 4 : 1));
        return X86_DONE;
    case 0x8D:
        return load_address(d);
    case 0x90:
        return number == 0 ? X86_DONE : X86_UNKNOWN;
    case 0x98: case 0x99:
        return widen(d, op);
    case 0xA8: case 0xA9:
        return with_accumulator(d, alu_test, op, 0);
    case 0xC2: {
        unsigned drop = d->next[0] | (unsigned)d->next[1] << 8;

        return back(d, drop);
    }
    case 0xC3:
        return back(d, 0);
    case 0xC9:
        return leave(d);
    case 0xE8:
        return call(d);
    case 0xE9: case 0xEB:
        return jump(d, op == 0xE9 ? 4 : 1, 1);
    default:
        return X86_UNKNOWN;
    }
}
