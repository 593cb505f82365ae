/* ccs.c - moves an LM629 by a PIC18F4520 at 20 MHz, for the CCS compiler.
 *
 *     D0-D7   PORTD          CS  PIN_B0     RD  PIN_B2     RST  PIN_B4
 *                            PS  PIN_B1     WR  PIN_B3
 */
#include <18F4520.h>
#fuses HS, NOWDT, NOLVP, NOPROTECT
#use delay(clock=20M)
#use rs232(baud=9600, xmit=PIN_C6, rcv=PIN_C7)
#use fast_io(D)

#include "ccs_bus.c"

#define SAMPLES 20000
#define NEAR 6                    // counts

/* Writes a word, its high byte first, and waits. */
void WriteWord(int16 value)
{
   Lm_WriteData(make8(value, 1));
   Lm_WriteData(make8(value, 0));
   Lm_Ready();
}

void WriteLong(int32 value)
{
   WriteWord(value >> 16);
   WriteWord(value);
}

signed int32 ReadPosition()
{
   int8 b[4];
   int i;

   Lm_Command(0x0A);             // RDRP
   for (i = 0; i < 4; i++) {
      if (i == 2)
         Lm_Ready();
      b[i] = Lm_ReadData();
   }
   return make32(b[0], b[1], b[2], b[3]);
}

void Move(signed int32 target)
{
   signed int32 at;
   long n;
   short done;                    // a bit

   Lm_Command(0x1D);              // RSTI
   WriteWord(0);
   Lm_Command(0x1F);              // LTRJ
   WriteWord(0x002A);
   WriteLong(2150);               // acceleration
   WriteLong(167772);             // velocity
   WriteLong(target);
   Lm_Command(0x01);              // STT
   done = FALSE;
   for (n = 0; n < SAMPLES && !done; n++) {
      delay_ms(1);
      done = (Lm_Status() & 4) >> 2;
   }
   delay_ms(50);
   at = ReadPosition();
   printf("position %Ld\r\n", at);
   if (at < target - NEAR || at > target + NEAR || Lm_Status() & 0x22)
      printf("failed\r\n");      // elsewhere, a position error or a command error
}

void main()
{
   int8 status;

   setup_adc_ports(NO_ANALOGS);
   Lm_Init();
   status = Lm_Status();
   printf(status == 0x84 || status == 0xC4 ? "reset\r\n" : "failed\r\n");
   Lm_Command(0x1E);              // LFIL
   WriteWord(0x0008);
   WriteWord(200);
   Lm_Command(0x04);              // UDF
   Move(4000);
   MOVE(-1000);                   // CCS takes either case
   printf("done\r\n");
}
