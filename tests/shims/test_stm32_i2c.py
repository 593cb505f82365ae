"""I2C of the STM32 shim: a port expander, by HAL and by the Standard Peripheral Library."""

from collections.abc import Callable
from pathlib import Path

import pytest

from tests.cpu.test_stm32_i2c import expander_board
from tests.shims.conftest import Run

HAL = """
#include "stm32f1xx_hal.h"
#include <stdio.h>
static I2C_HandleTypeDef bus;
static int sent, failed;
extern "C" void HAL_I2C_MemTxCpltCallback(I2C_HandleTypeDef *) { sent++; }
extern "C" void HAL_I2C_ErrorCallback(I2C_HandleTypeDef *) { failed++; }
static uint8_t inputs(void)
{
    uint8_t got = 0;
    HAL_I2C_Mem_Read(&bus, 0x40, 0, I2C_MEMADD_SIZE_8BIT, &got, 1, 10);
    return got;
}
int main(void)
{
    uint8_t low = 0xFE, high = 0xFF, at = 3, got[3] = {0, 0, 0};
    GPIO_InitTypeDef pins = {GPIO_PIN_6 | GPIO_PIN_7, GPIO_MODE_AF_OD, GPIO_NOPULL, 0, 0};
    HAL_Init();
    __HAL_RCC_GPIOB_CLK_ENABLE();
    __HAL_RCC_I2C1_CLK_ENABLE();
    HAL_GPIO_Init(GPIOB, &pins);
    bus.Instance = I2C1;
    bus.Init.ClockSpeed = 400000;
    HAL_I2C_Init(&bus);
    printf("%d ", HAL_I2C_Mem_Write(&bus, 0x40, 1, I2C_MEMADD_SIZE_8BIT, &low, 1, 10));
    printf("%d ", HAL_I2C_Mem_Write(&bus, 0x40, 3, I2C_MEMADD_SIZE_8BIT, &low, 1, 10));
    printf("%02X ", inputs());
    HAL_I2C_Mem_Write_IT(&bus, 0x40, 1, I2C_MEMADD_SIZE_8BIT, &high, 1);
    printf("%02X ", inputs());
    HAL_I2C_Master_Transmit(&bus, 0x40, &at, 1, HAL_MAX_DELAY);
    HAL_I2C_Master_Receive_DMA(&bus, 0x40, got, 3);
    printf("%02X %02X %02X ", got[0], got[1], got[2]);
    printf("%d ", HAL_I2C_Mem_Write(&bus, 0x42, 1, I2C_MEMADD_SIZE_8BIT, &low, 1, 10));
    printf("%u ", (unsigned)HAL_I2C_GetError(&bus));
    HAL_I2C_Master_Receive_IT(&bus, 0x44, got, 1);
    printf("%d %d ", sent, failed);
    printf("%d ", HAL_I2C_IsDeviceReady(&bus, 0x40, 2, 1));
    printf("%d\\n", HAL_I2C_IsDeviceReady(&bus, 0x46, 2, 1));
    return 0;
}
"""
STDPERIPH = """
#include "stm32f10x.h"
#include <stdio.h>
static int until(uint32_t event)
{
    for (int turn = 0; turn < 1000; turn++) {
        if (I2C_CheckEvent(I2C1, event))
            return 1;
        if (I2C_GetFlagStatus(I2C1, I2C_FLAG_AF)) {
            I2C_ClearFlag(I2C1, I2C_FLAG_AF);
            I2C_GenerateSTOP(I2C1, ENABLE);
            return 0;
        }
    }
    return 0;
}
static int begin(uint8_t address, uint8_t way)
{
    I2C_GenerateSTART(I2C1, ENABLE);
    until(I2C_EVENT_MASTER_MODE_SELECT);
    I2C_Send7bitAddress(I2C1, address, way);
    return until(way == I2C_Direction_Receiver ? I2C_EVENT_MASTER_RECEIVER_MODE_SELECTED
                                               : I2C_EVENT_MASTER_TRANSMITTER_MODE_SELECTED);
}
static int put(uint8_t address, const uint8_t *bytes, int count)
{
    if (!begin(address, I2C_Direction_Transmitter))
        return 0;
    while (count--) {
        I2C_SendData(I2C1, *bytes++);
        if (!until(I2C_EVENT_MASTER_BYTE_TRANSMITTED))
            return 0;
    }
    return 1;
}
static void get(uint8_t address, uint8_t *bytes, int count)
{
    I2C_AcknowledgeConfig(I2C1, ENABLE);
    begin(address, I2C_Direction_Receiver);
    while (count) {
        if (count == 1) {
            I2C_AcknowledgeConfig(I2C1, DISABLE);
            I2C_GenerateSTOP(I2C1, ENABLE);
        }
        if (until(I2C_EVENT_MASTER_BYTE_RECEIVED)) {
            *bytes++ = I2C_ReceiveData(I2C1);
            count--;
        }
    }
    while (I2C_GetFlagStatus(I2C1, I2C_FLAG_BUSY)) ;
}
static uint8_t inputs(void)
{
    const uint8_t at[] = {0};
    uint8_t got = 0;
    put(0x40, at, 1);
    get(0x40, &got, 1);
    return got;
}
static void stop(void) { I2C_GenerateSTOP(I2C1, ENABLE); }
int main(void)
{
    const uint8_t low[] = {1, 0xFE}, out[] = {3, 0xFE}, high[] = {1, 0xFF}, own[] = {3};
    uint8_t got[3];
    I2C_InitTypeDef how = {400000, I2C_Mode_I2C, I2C_DutyCycle_2, 0, I2C_Ack_Enable,
                           I2C_AcknowledgedAddress_7bit};
    GPIO_InitTypeDef pins = {GPIO_Pin_6 | GPIO_Pin_7, GPIO_Speed_50MHz, GPIO_Mode_AF_OD};
    RCC_APB2PeriphClockCmd(RCC_APB2Periph_GPIOB, ENABLE);
    RCC_APB1PeriphClockCmd(RCC_APB1Periph_I2C1, ENABLE);
    GPIO_Init(GPIOB, &pins);
    I2C_Init(I2C1, &how);
    I2C_Cmd(I2C1, ENABLE);
    printf("%d ", put(0x40, low, 2)); stop();
    printf("%d ", put(0x40, out, 2)); stop();
    printf("%02X ", inputs());
    put(0x40, high, 2); stop();
    printf("%02X ", inputs());
    put(0x40, own, 1);
    get(0x40, got, 3);
    printf("%02X %02X %02X ", got[0], got[1], got[2]);
    put(0x40, own, 1);
    I2C_AcknowledgeConfig(I2C1, ENABLE);
    I2C_NACKPositionConfig(I2C1, I2C_NACKPosition_Next);       /* two bytes: POS, then BTF */
    begin(0x40, I2C_Direction_Receiver);
    I2C_AcknowledgeConfig(I2C1, DISABLE);
    while (!I2C_GetFlagStatus(I2C1, I2C_FLAG_BTF)) ;
    stop();
    printf("%02X ", I2C_ReceiveData(I2C1));
    printf("%02X ", I2C_ReceiveData(I2C1));
    printf("%d %d\\n", put(0x42, low, 2), I2C_GetFlagStatus(I2C1, I2C_FLAG_BUSY));
    return 0;
}
"""


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (HAL, "0 0 7E 7F FE FE FE 1 4 1 1 0 1\n"),
        (HAL.replace("f1xx", "f4xx"), "0 0 7E 7F FE FE FE 1 4 1 1 0 1\n"),
        (STDPERIPH, "1 1 7E 7F FE FE FE FE FE 0 0\n"),
    ],
    ids=["HAL F1", "HAL F4", "StdPeriph"],
)
def test_either_library_drives_an_expander(
    driver: Callable[..., Path], run: Run, text: str, said: str
) -> None:
    ran = run(driver("stm32", text), expander_board("PCA9554"))
    assert (ran.said, ran.bus) == (said, [])


def test_a_port_without_its_clock_has_no_i2c_either(driver: Callable[..., Path], run: Run) -> None:
    text = HAL.replace("__HAL_RCC_GPIOB_CLK_ENABLE();", "")
    ran = run(driver("stm32", text), expander_board("PCA9554"))
    assert ran.said == "1 1 00 00 00 00 00 1 4 0 3 1 1\n"
    assert ran.errors.startswith("vbus: GPIOB is used while its clock is off")
