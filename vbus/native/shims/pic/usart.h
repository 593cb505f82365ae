/* usart.h - C18's functions of the USART, which is the console. License: Apache-2.0. */
#ifndef VBUS_SHIM_PIC_USART_H
#define VBUS_SHIM_PIC_USART_H

#include "p18cxxx.h"

enum {
    USART_TX_INT_ON = 0xFF, USART_TX_INT_OFF = 0x7F, USART_RX_INT_ON = 0xFF, USART_RX_INT_OFF = 0xBF,
    USART_BRGH_HIGH = 0xFF, USART_BRGH_LOW = 0xEF, USART_CONT_RX = 0xFF, USART_SINGLE_RX = 0xF7,
    USART_SYNC_MODE = 0xFF, USART_ASYNCH_MODE = 0xFE, USART_NINE_BIT = 0xFF, USART_EIGHT_BIT = 0xFD
};
static inline void OpenUSART(unsigned char, unsigned) {}
static inline void CloseUSART(void) {}
static inline char BusyUSART(void) { return 0; }
static inline char DataRdyUSART(void) { return vbus_shim::console_ready(); }
static inline void WriteUSART(char value) { TXREG = value; }
static inline char ReadUSART(void) { return (char)(uint8_t)RCREG; }
static inline void putsUSART(const char *text)
{
    do
        WriteUSART(*text); /* its final zero, too, as C18's does */
    while (*text++ != '\0');
}
#define putcUSART WriteUSART
#define getcUSART ReadUSART
#define putrsUSART putsUSART

#endif
