/* run_form(form, state): load every register from the state, call the form, store them again. */
.text
.globl run_form
#ifdef __x86_64__
run_form:
    push %rbx; push %rbp; push %r12; push %r13; push %r14; push %r15
    mov %rdi, called(%rip)
    mov %rsi, given(%rip)
    pushq 128(%rsi)
    movdqu 136(%rsi), %xmm0; movdqu 152(%rsi), %xmm1; movdqu 168(%rsi), %xmm2
    movdqu 184(%rsi), %xmm3; movdqu 200(%rsi), %xmm4; movdqu 216(%rsi), %xmm5
    movdqu 232(%rsi), %xmm6; movdqu 248(%rsi), %xmm7
    mov 0(%rsi), %rax; mov 8(%rsi), %rcx; mov 16(%rsi), %rdx; mov 24(%rsi), %rbx
    mov 40(%rsi), %rbp; mov 56(%rsi), %rdi; mov 64(%rsi), %r8; mov 72(%rsi), %r9
    mov 80(%rsi), %r10; mov 88(%rsi), %r11; mov 96(%rsi), %r12; mov 104(%rsi), %r13
    mov 112(%rsi), %r14; mov 120(%rsi), %r15; mov 48(%rsi), %rsi
    popf
    call *called(%rip)
    pushf
    push %rsi
    mov given(%rip), %rsi
    mov %rax, 0(%rsi); mov %rcx, 8(%rsi); mov %rdx, 16(%rsi); mov %rbx, 24(%rsi)
    mov %rbp, 40(%rsi); mov %rdi, 56(%rsi); mov %r8, 64(%rsi); mov %r9, 72(%rsi)
    mov %r10, 80(%rsi); mov %r11, 88(%rsi); mov %r12, 96(%rsi); mov %r13, 104(%rsi)
    mov %r14, 112(%rsi); mov %r15, 120(%rsi)
    popq 48(%rsi)
    popq 128(%rsi)
    movdqu %xmm0, 136(%rsi); movdqu %xmm1, 152(%rsi); movdqu %xmm2, 168(%rsi)
    movdqu %xmm3, 184(%rsi); movdqu %xmm4, 200(%rsi); movdqu %xmm5, 216(%rsi)
    movdqu %xmm6, 232(%rsi); movdqu %xmm7, 248(%rsi)
    cld
    pop %r15; pop %r14; pop %r13; pop %r12; pop %rbp; pop %rbx
    ret
.data
called: .quad 0
given: .quad 0
#else
run_form:
    push %ebx; push %ebp; push %esi; push %edi
    mov 20(%esp), %edi
    mov 24(%esp), %esi
    mov %edi, called
    mov %esi, given
    pushl 32(%esi)
    movdqu 36(%esi), %xmm0; movdqu 52(%esi), %xmm1; movdqu 68(%esi), %xmm2
    movdqu 84(%esi), %xmm3; movdqu 100(%esi), %xmm4; movdqu 116(%esi), %xmm5
    movdqu 132(%esi), %xmm6; movdqu 148(%esi), %xmm7
    mov 0(%esi), %eax; mov 4(%esi), %ecx; mov 8(%esi), %edx; mov 12(%esi), %ebx
    mov 20(%esi), %ebp; mov 28(%esi), %edi; mov 24(%esi), %esi
    popf
    call *called
    pushf
    push %esi
    mov given, %esi
    mov %eax, 0(%esi); mov %ecx, 4(%esi); mov %edx, 8(%esi); mov %ebx, 12(%esi)
    mov %ebp, 20(%esi); mov %edi, 28(%esi)
    popl 24(%esi)
    popl 32(%esi)
    movdqu %xmm0, 36(%esi); movdqu %xmm1, 52(%esi); movdqu %xmm2, 68(%esi)
    movdqu %xmm3, 84(%esi); movdqu %xmm4, 100(%esi); movdqu %xmm5, 116(%esi)
    movdqu %xmm6, 132(%esi); movdqu %xmm7, 148(%esi)
    cld
    pop %edi; pop %esi; pop %ebp; pop %ebx
    ret
.data
called: .long 0
given: .long 0
#endif
.section .note.GNU-stack,"",@progbits
