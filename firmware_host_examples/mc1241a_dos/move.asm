; move.asm - a DOS program that moves axis 1 of an MC1241A on an ISA card at 340h, by its interrupt.
;
; The card: 340h data, 342h commands, 344h HostRdy in D7, 348h reset; IRQ 5. Every packet's checksum is
; read and compared. The timer's tick (int 1Ch) counts while the motor moves.
        cpu     8086
        org     100h

DATA    equ     340h
COMMAND equ     342h
READY   equ     344h
RESET   equ     348h
IRQ     equ     5

SET_1       equ 01h
SET_POS     equ 10h
SET_VEL     equ 11h
SET_ACC     equ 12h
UPDATE      equ 1Ah
INTRPT_MASK equ 2Fh
GET_INTRPT  equ 30h
RST_INTRPT  equ 32h
ACTL_POS    equ 37h
STEP_RATIO  equ 68h
PHASE_2     equ 74h
MTR_CMD     equ 77h
COMPLETE    equ 0001h

%macro  packet 1                ; a command that takes nothing
        mov     al, %1
        call    begin
        call    finish
%endmacro

%macro  packet 2                ; one that takes a word
        mov     al, %1
        call    begin
        mov     ax, %2
        call    give
        call    finish
%endmacro

%macro  packet 3                ; one that takes two words
        mov     al, %1
        call    begin
        mov     ax, %2
        call    give
        mov     ax, %3
        call    give
        call    finish
%endmacro

start:  mov     ax, 3500h + 8 + IRQ
        int     21h
        mov     [old_irq], bx
        mov     [old_irq + 2], es
        mov     ax, 351Ch
        int     21h
        mov     [old_tick], bx
        mov     [old_tick + 2], es
        mov     dx, tick
        mov     ax, 251Ch
        int     21h
        mov     dx, service
        mov     ax, 2500h + 8 + IRQ
        int     21h

        mov     dx, RESET
        xor     al, al
        out     dx, al
        mov     ah, 2Ch         ; a hundredth of a second passes
        int     21h
        mov     bl, dl
pause:  int     21h
        cmp     dl, bl
        je      pause

        mov     al, SET_1
        call    begin
        call    take
        call    finish
        packet  PHASE_2
        packet  STEP_RATIO, 40
        packet  MTR_CMD, 24000
        packet  SET_VEL, 24, 0
        packet  SET_ACC, 0, 4000h
        packet  INTRPT_MASK, COMPLETE

        in      al, 21h         ; let the card's interrupt through
        mov     [old_mask], al
        and     al, ~(1 << IRQ) & 0FFh
        out     21h, al

        mov     si, targets
next:   lodsw
        mov     cx, ax
        lodsw
        mov     byte [done], 0
        push    si
        mov     si, ax
        packet  SET_POS, cx, si
        packet  UPDATE
        pop     si
wait_:  hlt                     ; until the interrupt, or a tick
        cmp     byte [done], 0
        je      wait_
        mov     al, ACTL_POS
        call    begin
        call    take
        push    ax
        call    take
        push    ax
        call    finish
        mov     dx, text_at
        mov     ah, 9
        int     21h
        pop     ax
        pop     bx
        call    number
        mov     dx, line
        mov     ah, 9
        int     21h
        cmp     si, targets_end
        jb      next

        cmp     word [ticks], 2
        mov     al, 1
        jb      leave_          ; the timer does not tick
        xor     al, al
leave_: push    ax
        mov     al, [old_mask]
        out     21h, al
        push    ds
        lds     dx, [old_irq]
        mov     ax, 2500h + 8 + IRQ
        int     21h
        pop     ds
        push    ds
        lds     dx, [old_tick]
        mov     ax, 251Ch
        int     21h
        pop     ds
        pop     ax
        mov     ah, 4Ch
        int     21h

; --- interrupts ---------------------------------------------------------------------------------

tick:   inc     word [cs:ticks]
        jmp     far [cs:old_tick]

service:
        push    ax
        push    dx
        push    ds
        push    cs
        pop     ds
        mov     al, GET_INTRPT
        call    begin
        call    take
        call    finish
        packet  RST_INTRPT, ~COMPLETE & 0FFh
        mov     byte [done], 1
        mov     al, 20h         ; end of interrupt
        out     20h, al
        pop     ds
        pop     dx
        pop     ax
        iret

; --- packets ------------------------------------------------------------------------------------

ready:  push    ax
        mov     dx, READY
.poll:  in      al, dx
        test    al, 80h
        jz      .poll
        pop     ax
        ret

begin:  call    ready           ; command in al
        mov     dx, COMMAND
        out     dx, al
        xor     ah, ah
        mov     [sum], ax
        ret

give:   call    ready           ; word in ax
        add     [sum], ax
        mov     dx, DATA
        xchg    al, ah
        out     dx, al
        xchg    al, ah
        out     dx, al
        ret

take:   call    ready           ; gives a word in ax
        mov     dx, DATA
        in      al, dx
        mov     ah, al
        in      al, dx
        add     [sum], ax
        ret

finish: push    word [sum]
        call    take
        pop     dx
        cmp     ax, dx
        jne     broken
        ret

broken: mov     dx, wrong
        mov     ah, 9
        int     21h
        mov     ax, 4C02h
        int     21h

; --- the number in bx:ax, signed, by DOS's character output ---------------------------------------

number: test    bx, bx
        jns     .plus
        push    ax
        mov     dl, '-'
        mov     ah, 2
        int     21h
        pop     ax
        not     bx
        neg     ax
        sbb     bx, -1
.plus:  xor     cx, cx          ; positions of this program fit 16 bits
        mov     di, 10
.digit: xor     dx, dx
        div     di
        push    dx
        inc     cx
        test    ax, ax
        jnz     .digit
.show:  pop     dx
        add     dl, '0'
        mov     ah, 2
        int     21h
        loop    .show
        ret

targets:
        dw      0, 6400, -1, -3200, 0, 0 ; high word first: half a turn, a quarter back, home
targets_end:
text_at db      'at $'
line    db      ' counts', 13, 10, '$'
wrong   db      'checksum', 13, 10, '$'
done    db      0
old_mask db     0
ticks   dw      0
sum     dw      0
old_irq dd      0
old_tick dd     0
