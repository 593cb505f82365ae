/* stm32f103.h - the registers of an STM32F103 that this example uses, named as in ST's StdPeriph. */
#ifndef STM32F103_H
#define STM32F103_H

#include <stdint.h>

#define __IO volatile

typedef struct {
    __IO uint32_t CRL, CRH, IDR, ODR, BSRR, BRR, LCKR;
} GPIO_TypeDef;

typedef struct {
    __IO uint32_t CR, CFGR, CIR, APB2RSTR, APB1RSTR, AHBENR, APB2ENR, APB1ENR, BDCR, CSR;
} RCC_TypeDef;

typedef struct {
    __IO uint32_t IMR, EMR, RTSR, FTSR, SWIER, PR;
} EXTI_TypeDef;

typedef struct {
    __IO uint32_t EVCR, MAPR, EXTICR[4];
} AFIO_TypeDef;

typedef struct {
    __IO uint32_t SR, DR, BRR, CR1, CR2, CR3, GTPR;
} USART_TypeDef;

typedef struct {
    __IO uint32_t CR1, CR2, SMCR, DIER, SR, EGR, CCMR1, CCMR2, CCER, CNT, PSC, ARR;
} TIM_TypeDef;

typedef struct {
    __IO uint32_t BTCR[8];
} FSMC_Bank1_TypeDef;

typedef struct {
    __IO uint32_t CTRL, LOAD, VAL, CALIB;
} SysTick_Type;

#define TIM2 ((TIM_TypeDef *)0x40000000)
#define AFIO ((AFIO_TypeDef *)0x40010000)
#define EXTI ((EXTI_TypeDef *)0x40010400)
#define GPIOA ((GPIO_TypeDef *)0x40010800)
#define GPIOB ((GPIO_TypeDef *)0x40010C00)
#define GPIOC ((GPIO_TypeDef *)0x40011000)
#define USART1 ((USART_TypeDef *)0x40013800)
#define RCC ((RCC_TypeDef *)0x40021000)
#define FSMC_Bank1 ((FSMC_Bank1_TypeDef *)0xA0000000)
#define SysTick ((SysTick_Type *)0xE000E010)
#define NVIC_ISER ((__IO uint32_t *)0xE000E100)

#define RCC_CR_HSEON 0x00010000
#define RCC_CR_HSERDY 0x00020000
#define RCC_CR_PLLON 0x01000000
#define RCC_CR_PLLRDY 0x02000000
#define RCC_CFGR_SW_PLL 0x00000002
#define RCC_CFGR_SWS_PLL 0x00000008
#define RCC_CFGR_PLL_9_X_HSE 0x001D0400
#define RCC_AHBENR_FSMCEN 0x00000100
#define RCC_APB2ENR_AFIOEN 0x00000001
#define RCC_APB2ENR_IOPAEN 0x00000004
#define RCC_APB2ENR_IOPBEN 0x00000008
#define RCC_APB2ENR_IOPCEN 0x00000010
#define RCC_APB2ENR_USART1EN 0x00004000
#define RCC_APB1ENR_TIM2EN 0x00000001
#define USART_SR_TXE 0x0080
#define USART_SR_TC 0x0040
#define TIM_CR1_CEN 0x0001
#define TIM_EGR_UG 0x0001
#define SysTick_CTRL_CLKSOURCE 4
#define SysTick_CTRL_TICKINT 2
#define SysTick_CTRL_ENABLE 1
#define EXTI9_5_IRQn 23

#endif
