/* c18.c - moves an LM629 by a PIC18F4520 at 20 MHz, for Microchip's C18.
 *
 *     D0-D7   PORTD          /CS  RB0       /RD  RB2       /RST  RB4
 *                            /PS  RB1       /WR  RB3
 */
#include <p18f4520.h>
#include <delays.h>
#include <usart.h>

#pragma config OSC = HS, WDT = OFF, LVP = OFF

#define CS LATBbits.LATB0
#define PS LATBbits.LATB1
#define RD LATBbits.LATB2
#define WR LATBbits.LATB3
#define RST LATBbits.LATB4
#define NEAR 6 /* counts */

static void text(const rom far char *message)
{
    while (*message)
        putcUSART(*message++);
}

static void number(long value)
{
    char digits[11];
    unsigned char count = 0;

    if (value < 0) {
        putcUSART('-');
        value = -value;
    }
    do {
        digits[count++] = (char)('0' + value % 10);
        value /= 10;
    } while (value);
    while (count)
        putcUSART(digits[--count]);
}

static unsigned char read_cycle(void)
{
    unsigned char value;

    CS = 0;
    RD = 0;
    Nop();
    value = PORTD;
    RD = 1;
    CS = 1;
    return value;
}

static void write_cycle(unsigned char value)
{
    CS = 0;
    WR = 0;
    LATD = value;
    DDRD = 0x00;
    WR = 1;
    CS = 1;
    DDRD = 0xFF;
}

static unsigned char status(void)
{
    PS = 0;
    return read_cycle();
}

static void ready(void)
{
    while (status() & 1)
        Delay10TCYx(5);
}

static void command(unsigned char code)
{
    ready();
    PS = 0;
    write_cycle(code);
    ready();
}

static void word(unsigned int value)
{
    PS = 1;
    write_cycle((unsigned char)(value >> 8));
    write_cycle((unsigned char)value);
    ready();
}

static void long_word(unsigned long value)
{
    word((unsigned int)(value >> 16));
    word((unsigned int)value);
}

static long position(void)
{
    unsigned long value = 0;
    unsigned char turn;

    command(0x0A); /* RDRP */
    for (turn = 0; turn < 4; turn++) {
        if (turn == 2)
            ready();
        PS = 1;
        value = value << 8 | read_cycle();
    }
    return value & 0x80000000UL ? -(long)(0xFFFFFFFFUL - value) - 1 : (long)value;
}

static void move(long target)
{
    unsigned int polls = 0;
    long at;

    command(0x1D); /* RSTI */
    word(0);
    command(0x1F); /* LTRJ */
    word(0x002A);
    long_word(2150);
    long_word(167772);
    long_word((unsigned long)target);
    command(0x01); /* STT */
    while (!(status() & 4) && ++polls < 20000)
        Delay1KTCYx(5); /* 1 ms */
    Delay10KTCYx(25);   /* 50 ms */
    at = position();
    text("position ");
    number(at);
    text("\r\n");
    if (at < target - NEAR || at > target + NEAR || status() & 0x22)
        text("failed\r\n"); /* elsewhere, a position error or a command error */
}

void main(void)
{
    unsigned char after_reset;

    ADCON1 = 0x0F;
    LATB = 0x1F;
    TRISBbits.TRISB0 = 0;
    DDRB &= 0xE0;
    RST = 0;
    Delay10TCYx(10); /* 20 us */
    RST = 1;
    Delay10KTCYx(1); /* 2 ms */
    OpenUSART(USART_TX_INT_OFF & USART_RX_INT_OFF & USART_ASYNCH_MODE & USART_EIGHT_BIT
                  & USART_CONT_RX & USART_BRGH_HIGH,
              129);
    after_reset = status();
    text(after_reset == 0x84 || after_reset == 0xC4 ? "reset\r\n" : "failed\r\n");
    command(0x1E); /* LFIL */
    word(0x0008);
    word(200);
    command(0x04); /* UDF */
    move(4000);
    move(-1000);
    text("done\r\n");
}
