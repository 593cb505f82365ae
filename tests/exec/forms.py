"""Instruction forms for the decoder's test, as assembler text.

``%M`` stands for the memory operand, ``BASE`` for the start of plain memory or of the window.
Each form is assembled twice: once for plain memory, once for the window. Registers that point to
memory: bx, si, di (and r8, r13 with 64 bits); cx is a small count; bp is an odd bit offset.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

BINARY = ("add", "or", "adc", "sbb", "and", "sub", "xor", "cmp")
SHIFTS = ("rol", "ror", "rcl", "rcr", "shl", "shr", "sar")
CONDITIONS = (
    "o",
    "no",
    "b",
    "ae",
    "e",
    "ne",
    "be",
    "a",
    "s",
    "ns",
    "p",
    "np",
    "l",
    "ge",
    "le",
    "g",
)
REGISTERS = {"b": "%al %dl %ch", "w": "%ax %dx", "l": "%eax %edx", "q": "%rax %r12"}


@dataclass(frozen=True)
class Form:
    """One instruction.

    Attributes:
        text: AT&T assembler.
        plain: ``"s"``: the source (si) is plain memory in both runs; ``"d"``: the destination is.
        refused: the decoder must not know it.
        followed: it stands between two accesses, and everything is plain memory.
    """

    text: str
    plain: str = ""
    refused: bool = False
    followed: bool = False


def sizes(bits: int) -> str:
    return "bwlq" if bits == 64 else "bwl"


def _registers(size: str, bits: int) -> list[str]:
    registers = REGISTERS[size].split()
    if bits == 64 and size == "b":
        registers += ["%sil", "%r9b"]
    return registers


def operations(bits: int) -> Iterator[Form]:
    """Everything on one simple memory operand."""
    wide = sizes(bits)[1:]
    for size in sizes(bits):
        registers = _registers(size, bits)
        first = registers[0]
        for op in BINARY:
            for register in registers:
                yield Form(f"{op}{size} {register}, %M")
            yield Form(f"{op}{size} %M, {first}")
            yield Form(f"{op}{size} $0x35, %M")
            yield Form(f"{op}{size} $-3, %M")
            if size != "b":
                yield Form(f"{op}{size} $0x{'1234' if size == 'w' else '12345678'}, %M")
        for op in ("mov", "test", "xchg", "cmpxchg", "xadd"):
            for register in registers:
                yield Form(f"{op}{size} {register}, %M")
        for register in registers:
            yield Form(f"mov{size} %M, {register}")
        yield Form(f"mov{size} $0x5A, %M")
        yield Form(f"test{size} $0x5A, %M")
        for op in ("inc", "dec", "neg", "not", "mul", "imul"):
            yield Form(f"{op}{size} %M")
        for op in SHIFTS:
            for count in ("$1", "$3", "%cl"):
                yield Form(f"{op}{size} {count}, %M")
    for size in wide:
        first = REGISTERS[size].split()[0]
        for op in ("bt", "bts", "btr", "btc"):
            yield Form(f"{op}{size} $5, %M")
            yield Form(
                f"{op}{size} {'%bp' if size == 'w' else '%ebp' if size == 'l' else '%rbp'}, %M"
            )
        yield Form(f"imul{size} %M, {first}")
        yield Form(f"imul{size} $7, %M, {first}")
        yield Form(f"imul{size} $0x1234, %M, {first}")
        yield Form(f"bsf{size} %M, {first}")
        yield Form(f"bsr{size} %M, {first}")
        yield Form(f"movbe{size} %M, {first}")
        yield Form(f"movbe{size} {first}, %M")
        for count in ("$5", "$40", "%cl"):
            yield Form(f"shld{size} {count}, {first}, %M")
            yield Form(f"shrd{size} {count}, {first}, %M")
        if "bmi1" in processor():
            yield Form(f"tzcnt{size} %M, {first}")
        if "abm" in processor():
            yield Form(f"lzcnt{size} %M, {first}")
        if "popcnt" in processor():
            yield Form(f"popcnt{size} %M, {first}")
        for condition in ("e", "ne", "l", "a"):
            yield Form(f"cmov{condition} %M, {first}")
        yield Form(f"movzb{size} %M, {first}")
        yield Form(f"movsb{size} %M, {first}")
        if size != "w":
            yield Form(f"movzw{size} %M, {first}")
            yield Form(f"movsw{size} %M, {first}")
    if bits == 64:
        yield Form("movslq %M, %rdx")
        yield Form("movnti %rax, %M")
        yield Form("pushq %M; popq %rax")
        yield Form("pushq %rax; popq %M")
    else:
        yield Form("pushl %M; popl %eax")
        yield Form("pushl %eax; popl %M")
    for condition in CONDITIONS:
        yield Form(f"set{condition} %M")
    yield Form("movnti %eax, %M")
    yield Form("lock addl %eax, %M")
    yield Form("lock xaddb %al, %M")
    yield Form("lock cmpxchg8b %M")
    pointer = "%rdi" if bits == 64 else "%edi"
    same = f"movl ({pointer}), %eax; movl 4({pointer}), %edx; movl $0x1234567, %ebx"
    yield Form(f"{same}; cmpxchg8b ({pointer})")
    if bits == 64:
        yield Form("lock cmpxchg16b %M")
        same = "movq (%rdi), %rax; movq 8(%rdi), %rdx; movl $0x1234567, %ebx"
        yield Form(f"{same}; lock cmpxchg16b (%rdi)")
        yield Form("leaq %M, %rbx; xlatb")
    else:
        yield Form("leal %M, %ebx; xlatb")
    yield Form("jmp *%M", refused=True)
    yield Form("call *%M", refused=True)


def divisions(bits: int) -> Iterator[Form]:
    """By divisors that fit, of either sign; and by 0, which the processor refuses."""
    extensions = {"b": "cbtw", "w": "cwtd", "l": "cltd", "q": "cqto"}
    for size in sizes(bits):
        wide = 8 << "bwlq".index(size)
        high = "movb $0, %ah" if size == "b" else "xorl %edx, %edx"
        sign = (1 << wide - 1) - (1 << wide)
        odd, even = f"or{size} $1, %M", f"and{size} $-3, %M"
        if size == "q":
            top, bottom = "btsq $63, %M", "btrq $63, %M"
        else:
            top, bottom = f"or{size} ${sign}, %M", f"and{size} ${~sign}, %M"
        yield Form(f"{high}; {odd}; div{size} %M")
        yield Form(f"{extensions[size]}; {odd}; {bottom}; idiv{size} %M")
        yield Form(f"{extensions[size]}; {odd}; {even}; {top}; idiv{size} %M")
        yield Form(f"mov{size} $0, %M; div{size} %M", refused=True)
        yield Form(f"mov{size} $0, %M; idiv{size} %M", refused=True)
        most = {"b": "%al, %dl; movb $-128, %al; cbtw", "w": "%ax, %cx; movw $-32768, %ax; cwtd"}
        if size in most:
            yield Form(f"mov{size} {most[size]}; mov{size} $-1, %M; idiv{size} %M", refused=True)
    yield Form("movl $1, %M; movl $1, %edx; divl %M", refused=True)
    yield Form("movl $-1, %M; movl $0x80000000, %eax; cltd; idivl %M", refused=True)
    yield Form("movl $1, %M; movl $0x80000000, %eax; xorl %edx, %edx; idivl %M", refused=True)
    if bits == 64:
        yield Form("movq $-1, %M; xorl %eax, %eax; movabs $1 << 63, %rdx; idivq %M", refused=True)


def floats(bits: int) -> Iterator[Form]:
    """Moves and arithmetic of the x87; results go to memory, where they can be compared."""
    del bits
    for size, store in (("s", "fstpt"), ("l", "fstpt"), ("t", "fstpt")):
        yield Form(f"fninit; fld{size} %M; {store} 64+%M")
    for size in ("s", "l"):
        yield Form(f"fninit; fildl %M; fst{size} 64+%M; fstp{size} 80+%M")
        for op in ("fadd", "fmul", "fsub", "fsubr", "fdiv", "fdivr"):
            yield Form(f"fninit; fildl 96+%M; {op}{size} %M; fstpt 64+%M")
        yield Form(f"fninit; fildl 96+%M; fcom{size} %M; fnstsw 64+%M; fninit")
        yield Form(f"fninit; fildl 96+%M; fcomp{size} %M; fnstsw %ax; fninit")
    for size in ("s", "l", "q"):  # words of 2, 4 and 8 bytes
        load = {"s": "filds", "l": "fildl", "q": "fildll"}[size]
        yield Form(f"fninit; {load} %M; fistp{size.replace('q', 'll')} 64+%M")
        yield Form(f"fninit; {load} %M; fisttp{size.replace('q', 'll')} 64+%M")
    for size in ("s", "l"):
        yield Form(f"fninit; fildl 96+%M; fist{size} 64+%M; fiadd{size} %M; fstpt 64+%M")
        yield Form(f"fninit; fildl 96+%M; fimul{size} %M; fidiv{size} 8+%M; fstpt 64+%M")
        yield Form(f"fninit; fildl 96+%M; ficom{size} %M; fnstsw %ax; fninit")
    yield Form("fninit; fildl %M; fildl 4+%M; fbstp 64+%M; fbstp 80+%M")
    yield Form("fninit; fildl %M; fbstp 64+%M; fbld 64+%M; fstpt 80+%M")
    yield Form("fninit; fnstcw %M; andw $0x0F00, 2+%M; orw $0x7F, 2+%M; fldcw 2+%M; fnstcw 8+%M")
    yield Form("fninit; fildl %M; fildl 8+%M; fnstsw 16+%M; fstpt 64+%M; fstpt 80+%M")
    yield Form("fnstenv %M", refused=True)
    yield Form("fnsave %M", refused=True)


def avx(bits: int) -> Iterator[Form]:
    """Moves with a VEX prefix, and what they leave in upper halves."""
    show = "vmovdqu %ymm1, 96+%M; vzeroupper"
    fill = "vmovdqu 160+%M, %ymm1"
    for op in ("vmovups", "vmovupd", "vmovdqu"):
        yield Form(f"{op} %M, %ymm1; {op} %ymm1, 96+%M; vzeroupper")
        yield Form(f"{fill}; {op} %M, %xmm1; {show}")
        yield Form(f"{fill}; {op} %xmm1, 32+%M; vzeroupper")
    for op in ("vmovaps", "vmovapd", "vmovdqa"):  # the memory of the forms is aligned to 32 bytes
        yield Form(f"{op} %M, %ymm1; {op} %ymm1, 96+%M; vzeroupper")
        yield Form(f"{op} %M, %xmm1; {op} %xmm1, 96+%M")
    for op in ("vmovntps", "vmovntpd", "vmovntdq"):
        yield Form(f"{fill}; {op} %ymm1, %M; vzeroupper")
        yield Form(f"{op} %xmm1, %M")
    for op in ("vmovss", "vmovsd", "vmovd", "vmovq"):
        yield Form(f"{fill}; {op} %M, %xmm1; {show}")
        yield Form(f"{op} %xmm1, %M")
    for op in ("vmovlps", "vmovhps", "vmovlpd", "vmovhpd"):
        yield Form(f"{fill}; {op} %M, %xmm3, %xmm1; {show}")
        yield Form(f"{op} %xmm1, %M")
    yield Form(f"vlddqu %M, %ymm1; {show}")
    yield Form(f"{fill}; vmovntdqa %M, %xmm1; {show}")
    yield Form(f"{fill}; movups %M, %xmm1; {show}")
    yield Form(f"vzeroupper; movups %M, %xmm1; {show}")
    yield Form("vpaddb %M, %xmm1, %xmm2", refused=True)
    yield Form("vbroadcastss %M, %ymm1; vzeroupper", refused=True)
    if bits == 64:
        yield Form("vmovdqu %M, %ymm9; vmovdqu %ymm9, 96+%M; vzeroupper")
        yield Form("leaq 32+%M, %r9; vmovdqu (%r9), %xmm12; vmovdqu %xmm12, (%r9,%rcx,8)")
    if "avx512vl" in processor():
        yield Form("vmovdqu32 %M, %ymm1; vzeroupper", refused=True)


@cache
def processor() -> frozenset[str]:
    """Return what the processor can do."""
    text = Path("/proc/cpuinfo").read_text()
    line = next(line for line in text.splitlines() if line.startswith("flags"))
    return frozenset(line.split(":")[1].split())


def vectors(bits: int) -> Iterator[Form]:
    """Moves of XMM registers, as string functions and compilers use them."""
    for op in ("movups", "movupd", "movdqu", "movaps", "movapd", "movdqa"):
        yield Form(f"{op} %M, %xmm1")
        yield Form(f"{op} %xmm1, %M")
    for op in ("movss", "movsd", "movq", "movd", "movlps", "movhps", "movlpd", "movhpd"):
        yield Form(f"{op} %M, %xmm2")
        yield Form(f"{op} %xmm2, %M")
    for op in ("movntps", "movntpd", "movntdq"):
        yield Form(f"{op} %xmm1, %M")
    yield Form("paddb %M, %xmm1", refused=True)
    yield Form("movq %M, %mm1; emms", refused=True)
    yield Form("movdqu %M, %xmm7")
    yield Form("lddqu %M, %xmm1")
    yield Form("cvtsi2sd %M, %xmm1", refused=True)
    if "sse4_1" in processor():
        yield Form("movntdqa %M, %xmm1")
    if bits == 64:
        yield Form("movdqu %M, %xmm11; movdqu %xmm11, 64+%M")


def addresses(bits: int) -> Iterator[str]:
    """Every way to write an address; ``BASE`` is the start of the window or of plain memory."""
    a, b, si, di = (
        ("%rax", "%rbx", "%rsi", "%rdi") if bits == 64 else ("%eax", "%ebx", "%esi", "%edi")
    )
    c = "%rcx" if bits == 64 else "%ecx"
    del a
    yield f"({b})"
    yield f"16({b})"
    yield f"-16({b})"
    yield f"0x180({b})"
    yield f"-0x100({b})"
    for scale in (1, 2, 4, 8):
        yield f"({b},{c},{scale})"
        yield f"5({si},{c},{scale})"
        yield f"-0x90({di},{c},{scale})"
        yield f"BASE+0x40(,{c},{scale})"
    yield "BASE+0x48"
    if bits == 64:
        yield "BASE+0x48(%rip)"
        yield "(%r8)"
        yield "4(%r8,%rcx,2)"
        yield "(%r13)"
        yield "0x77(%r13,%rcx)"
        yield "8(%ebx)"
        yield "8(%ebx,%ecx,4)"


def strings(bits: int) -> Iterator[Form]:
    for size in sizes(bits):
        for op in ("movs", "stos", "lods", "cmps", "scas"):
            yield Form(f"{op}{size}")
            yield Form(f"std; {op}{size}; cld")
        for op in ("movs", "stos"):
            yield Form(f"rep {op}{size}")
        for op in ("cmps", "scas"):
            yield Form(f"repe {op}{size}")
            yield Form(f"repne {op}{size}")
        yield Form(f"rep movs{size}", plain="s")
        yield Form(f"rep movs{size}", plain="d")
        yield Form(f"movs{size}", plain="s")
        yield Form(f"cmps{size}", plain="d")
    if bits == 64:
        yield Form("addr32 movsb")


def between(bits: int) -> Iterator[str]:
    """What loops around an access are made of; ``%M`` is memory, ``%P`` a pointer to it."""
    push, pop = ("pushq", "popq") if bits == 64 else ("pushl", "popl")
    for size in sizes(bits):
        registers = _registers(size, bits)
        first, last = registers[0], registers[-1]
        for op in BINARY:
            yield f"{op}{size} {last}, {first}"
            yield f"{op}{size} {last}, %M"
            yield f"{op}{size} %M, {last}"
            yield f"{op}{size} $0x35, {first}"
            yield f"{op}{size} $-3, {last}"
            if size != "b":
                yield f"{op}{size} $0x1234, {first}"
        for op in ("mov", "test"):
            yield f"{op}{size} {last}, {first}"
            yield f"{op}{size} {first}, %M"
            yield f"{op}{size} $0x5A, {first}"
            yield f"{op}{size} $0x5A, {last}"
            yield f"{op}{size} $0x5A, %M"
        yield f"mov{size} %M, {last}"
        for op in ("inc", "dec", "neg", "not", "mul", "imul"):
            yield f"{op}{size} {last}"
            yield f"{op}{size} %M"
        if size != "w":
            for op in ("shl", "shr", "sar"):
                for count in ("$1", "$3", "%cl"):
                    yield f"{op}{size} {count}, {last}"
    for size in sizes(bits)[1:]:
        registers = REGISTERS[size].split()
        first, last = registers
        for condition in CONDITIONS:
            yield f"cmov{condition} {last}, {first}"
        yield f"cmove %M, {first}"
        yield f"bt{size} $5, {first}"
        yield f"bt{size} {last}, {first}"
        yield f"imul{size} {last}, {first}"
        yield f"imul{size} $7, {last}, {first}"
        yield f"imul{size} $0x1234, %M, {first}"
        yield f"movzb{size} %dl, {first}"
        yield f"movsb{size} %M, {first}"
        yield f"lea{size} -8(%P,%Q,4), {first}"
    for condition in CONDITIONS:
        yield f"set{condition} %dl"
        yield f"j{condition} 1f; movl $5, %eax; 1: decl %edx"
        yield f"j{condition} 1f; .skip 200, 0x90; xorl %eax, %edx; 1: decl %edx"
    yield "movl $0xFFFF8000, %eax; movzwl %ax, %edx; movswl %ax, %eax"
    yield "cbtw; cwtd"
    yield "cwtl; cltd"
    yield "nop; nopl (%P); nopw 64(%P,%Q); pause; endbr32; endbr64"
    yield "movl $7, %edx; 1: addl %edx, %eax; decl %edx; jne 1b"
    yield "movb $3, %ah; jmp 1f; movb $4, %ah; 1: addb %ah, %dl"
    yield f"{push} %S; {pop} %D"
    yield f"{push} %D; {push} $-5; {push} $0x12345678; {pop} %D; {pop} %D; {pop} %D"
    yield f"{push} %M; {pop} %D"
    yield "jmp 3f; 1: incl %edx; ret; 2: decl %eax; ret $8; 3: call 1b; %L -8(%S), %S; call 2b"
    yield f"{push} %B; mov %S, %B; movl %eax, -8(%B); addl $3, -8(%B); movl -8(%B), %edx; leave"
    yield f"%A %eax; {push} %B; mov %S, %B; {push} %D; {push} %D; leave"
    if bits == 64:
        yield "cltq; cqto"
        yield "movslq %edx, %rax"
        yield "movslq %M, %r12"
        yield "movabs $0x123456789ABCDEF0, %r12; movl $0x80000000, %edx; movq $-2, %rax"
        yield "movl BASE+0x48(%rip), %edx"
        yield "pushq %r12; popq %r9"
        yield "movl (%ebx), %eax"


# What may be seen half done, reaches beyond the text, or needs other registers.
NOT_FOLLOWED = (
    "lock addl %eax, %M",
    "xchgl %eax, %M",
    "cmpxchgl %edx, %M",
    "btsl $5, %M; xaddl %eax, %M",
    "rep stosb",
    "movsb",
    "roll $3, %edx",
    "movd %xmm1, %M",
    "cvtsi2sd %eax, %xmm1",
    "fildl %M; fistpl %M",
    "cpuid",
    "rdtsc",
    "call *%D",
    "jmp *%M",
    "cli",
    "inb $0x40, %al",
    "movl %fs:0, %eax",
    "divl %M; movl $0, %M; divl %M",
)


def followed(bits: int) -> Iterator[Form]:
    """Return instructions that are carried out between two accesses, and some that are not."""
    width = "r" if bits == 64 else "e"
    names = {
        "%M": f"32(%{width}bx)", "%P": f"%{width}bx", "%Q": f"%{width}cx", "%S": f"%{width}sp",
        "%D": f"%{width}dx", "%B": f"%{width}bp", "%L": "lea", "%A": "incl",
    }  # fmt: skip
    for refused, texts in ((False, between(bits)), (True, NOT_FOLLOWED)):
        for text in texts:
            for name, real in names.items():
                text = text.replace(name, real)
            yield Form(text, refused=refused, followed=True)


def forms(bits: int) -> list[Form]:
    result = []
    base = "%rbx" if bits == 64 else "%ebx"
    wide = (*vectors(bits), *floats(bits), *(avx(bits) if "avx" in processor() else ()))
    for form in (*operations(bits), *divisions(bits), *wide):
        result.append(Form(form.text.replace("%M", f"32({base})"), refused=form.refused))
    for address in addresses(bits):
        result.extend(
            Form(text.replace("%M", address))
            for text in ("movb %al, %M", "movl %M, %eax", "addl $0x12345678, %M", "shll $2, %M")
        )
    absolute = "movabs" if bits == 64 else "mov"
    result.append(Form(f"{absolute} BASE+8, %al"))
    result.append(Form(f"{absolute} %eax, BASE+8"))
    result.extend(strings(bits))
    result.extend(followed(bits))
    return result


def source(bits: int) -> str:
    """Return the assembler file: both versions of each form, and the table of them."""
    lines = [".text"]
    table = []
    word = ".quad" if bits == 64 else ".long"
    for number, form in enumerate(forms(bits)):
        for version, base in (("n", "plain_base"), ("t", "window_base")):
            text = form.text.replace("BASE", "plain_base" if form.followed else base)
            if form.followed and version == "t":
                text = f"hlt; {text}; hlt"
            lines += [f"{version}{number}:", f"    {text}", "    ret"]
        text = form.text.replace('"', '\\"')
        lines += [".section .rodata", f'm{number}: .asciz "{text}"', ".text"]
        flags = 1 if form.plain == "s" else 2 if form.plain == "d" else 0
        flags |= 4 * form.refused | 8 * form.followed
        table.append(f"    {word} n{number}, t{number}, m{number}, {flags}")
    lines += [".data", ".globl form_table", "form_table:", *table, f"    {word} 0, 0, 0, 0"]
    lines += ['.section .note.GNU-stack,"",@progbits']
    return "\n".join(lines) + "\n"
