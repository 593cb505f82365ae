| start.S - vectors, start and end of a 68000 that has its program at 0 and its RAM at 100000h.
        .section .vectors, "a"
        .long   _stack, start
        .fill   26, 4, 0
        .long   interrupt               | autovector of level 4
        .fill   227, 4, 0

        .text
        .globl  start
start:  lea     _sbss, %a0
1:      cmp.l   #_ebss, %a0
        bcc     2f
        clr.b   (%a0)+
        bra     1b
2:      jsr     main
        move    #0x2700, %sr            | the end: nothing can come any more, the result is in d0
        bra.s   .

        .globl  sleep
sleep:  stop    #0x2000
        move    #0x2700, %sr
        rts

interrupt:
        movem.l %d0-%d1/%a0-%a1, -(%sp)
        jsr     service
        movem.l (%sp)+, %d0-%d1/%a0-%a1
        rte

        .section .note.GNU-stack, "", @progbits
