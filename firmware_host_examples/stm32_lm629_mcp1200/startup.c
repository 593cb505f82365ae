/* startup.c - vector table and reset handler of an STM32F103, without a library. */
#include <stdint.h>

extern uint32_t _sidata, _sdata, _edata, _sbss, _ebss, _estack;
int main(void);
void SysTick_Handler(void);
void EXTI9_5_IRQHandler(void);

static void Default_Handler(void)
{
    for (;;)
        ;
}

void Reset_Handler(void)
{
    uint32_t *from = &_sidata, *to;
    register int result __asm__("r0");

    for (to = &_sdata; to < &_edata;)
        *to++ = *from++;
    for (to = &_sbss; to < &_ebss;)
        *to++ = 0;
    result = main();
    __asm__ volatile("cpsid i\n\tb ." : : "r"(result)); /* the end: nothing can come any more */
}

__attribute__((section(".isr_vector"), used)) static const void *const vectors[16 + 60] = {
    &_estack,
    (void *)Reset_Handler,
    (void *)Default_Handler, /* NMI */
    (void *)Default_Handler, /* HardFault */
    [15] = (void *)SysTick_Handler,
    [16 + 23] = (void *)EXTI9_5_IRQHandler,
};
