/* ccs_bus.c - the bus of an LM629 on the pins of a PIC, included by its program as CCS likes it. */
#byte PortD = 0xF83
#byte LatD  = 0xF8C
#bit  Strobe = 0xF8A.3            // LATB3: /WR

#define LM_CS PIN_B0
#define LM_PS PIN_B1
#define LM_RD PIN_B2
#define LM_RST PIN_B4

int8 Lm_Read()
{
   int8 value;

   output_low(LM_CS);
   output_low(LM_RD);
   delay_cycles(1);
   value = PortD;
   output_high(LM_RD);
   output_high(LM_CS);
   return value;
}

void Lm_Write(int8 value)
{
   output_low(LM_CS);
   Strobe = 0;
   LatD = value;
   SET_TRIS_D(0x00);
   Strobe = 1;
   output_high(LM_CS);
   SET_TRIS_D(0xFF);
}

int8 Lm_Status()
{
   output_low(LM_PS);
   return Lm_Read();
}

int8 Lm_ReadData()
{
   output_high(LM_PS);
   return Lm_Read();
}

void Lm_Ready()
{
   while (bit_test(Lm_Status(), 0))
      delay_us(10);
}

void Lm_Command(int8 command)
{
   Lm_Ready();
   output_low(LM_PS);
   Lm_Write(command);
   Lm_Ready();
}

void Lm_WriteData(int8 value)
{
   output_high(LM_PS);
   Lm_Write(value);
}

void Lm_Init()
{
   set_tris_d(0xFF);
   output_high(LM_CS);
   output_high(LM_PS);
   output_high(LM_RD);
   output_high(PIN_B3);
   output_low(LM_RST);
   delay_us(20);
   output_high(LM_RST);
   delay_ms(2);
}
