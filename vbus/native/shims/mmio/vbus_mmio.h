/* vbus_mmio.h - memory-mapped accesses that go through macros or functions, as bus cycles.
 *
 * Give it to the compiler with -include; it defines the names that platforms have for such accesses,
 * where they are not defined yet. In C++ also `vbus_reg8(address)`, an object that is read and
 * written like a register, behind REG8, MMIO8 and their like. A driver that casts a number to a
 * pointer by itself needs `vbus exec`. License: Apache-2.0.
 */
#ifndef VBUS_MMIO_H
#define VBUS_MMIO_H

#include "card_link.h"

#define VBUS_ADDRESS(address) ((unsigned long)(uintptr_t)(address))

/* Linux */
static inline uint8_t vbus_read8(unsigned long address) { return (uint8_t)card_read(address); }
static inline uint16_t vbus_read16(unsigned long address)
{
    return (uint16_t)card_read_wide(address, 2, 0);
}
static inline uint32_t vbus_read32(unsigned long address) { return card_read_wide(address, 4, 0); }
static inline uint16_t vbus_read16be(unsigned long address)
{
    return (uint16_t)card_read_wide(address, 2, 1);
}
static inline uint32_t vbus_read32be(unsigned long address) { return card_read_wide(address, 4, 1); }

#define VBUS_WRITE_WIDE(address, value, size, big)                                                      \
    card_write_wide(VBUS_ADDRESS(address), (uint32_t)(value), size, big)

#ifndef __iomem
#define __iomem
#endif
#ifndef readb
#define readb(address) vbus_read8(VBUS_ADDRESS(address))
#define readw(address) vbus_read16(VBUS_ADDRESS(address))
#define readl(address) vbus_read32(VBUS_ADDRESS(address))
#define writeb(value, address) VBUS_WRITE_WIDE(address, value, 1, 0)
#define writew(value, address) VBUS_WRITE_WIDE(address, value, 2, 0)
#define writel(value, address) VBUS_WRITE_WIDE(address, value, 4, 0)
#endif
#ifndef ioread8
#define ioread8(address) vbus_read8(VBUS_ADDRESS(address))
#define ioread16(address) vbus_read16(VBUS_ADDRESS(address))
#define ioread32(address) vbus_read32(VBUS_ADDRESS(address))
#define ioread16be(address) vbus_read16be(VBUS_ADDRESS(address))
#define ioread32be(address) vbus_read32be(VBUS_ADDRESS(address))
#define iowrite8(value, address) VBUS_WRITE_WIDE(address, value, 1, 0)
#define iowrite16(value, address) VBUS_WRITE_WIDE(address, value, 2, 0)
#define iowrite32(value, address) VBUS_WRITE_WIDE(address, value, 4, 0)
#define iowrite16be(value, address) VBUS_WRITE_WIDE(address, value, 2, 1)
#define iowrite32be(value, address) VBUS_WRITE_WIDE(address, value, 4, 1)
#endif

/* PowerPC */
#ifndef in_8
#define in_8(address) vbus_read8(VBUS_ADDRESS(address))
#define in_be16(address) vbus_read16be(VBUS_ADDRESS(address))
#define in_be32(address) vbus_read32be(VBUS_ADDRESS(address))
#define in_le16(address) vbus_read16(VBUS_ADDRESS(address))
#define in_le32(address) vbus_read32(VBUS_ADDRESS(address))
#define out_8(address, value) VBUS_WRITE_WIDE(address, value, 1, 0)
#define out_be16(address, value) VBUS_WRITE_WIDE(address, value, 2, 1)
#define out_be32(address, value) VBUS_WRITE_WIDE(address, value, 4, 1)
#define out_le16(address, value) VBUS_WRITE_WIDE(address, value, 2, 0)
#define out_le32(address, value) VBUS_WRITE_WIDE(address, value, 4, 0)
#endif

/* Zephyr, Xilinx, Nios */
#ifndef sys_read8
#define sys_read8(address) vbus_read8(VBUS_ADDRESS(address))
#define sys_write8(value, address) VBUS_WRITE_WIDE(address, value, 1, 0)
#endif
#ifndef Xil_In8
#define Xil_In8(address) vbus_read8(VBUS_ADDRESS(address))
#define Xil_Out8(address, value) VBUS_WRITE_WIDE(address, value, 1, 0)
#endif
#ifndef IORD_8DIRECT
#define IORD_8DIRECT(base, offset) vbus_read8(VBUS_ADDRESS(base) + (offset))
#define IOWR_8DIRECT(base, offset, value) VBUS_WRITE_WIDE(VBUS_ADDRESS(base) + (offset), value, 1, 0)
#endif

#ifdef __cplusplus

/* A register of 8 bits at an address. */
class vbus_reg8 {
public:
    template <class T> explicit vbus_reg8(T address) : address_((unsigned long)address) {}
    operator uint8_t() const { return vbus_read8(address_); }
    uint8_t operator=(int value) const { card_write(address_, (uint8_t)value); return (uint8_t)value; }
    uint8_t operator=(const vbus_reg8 &other) const { return *this = (uint8_t)other; }
    uint8_t operator|=(int value) const { return *this = *this | value; }
    uint8_t operator&=(int value) const { return *this = *this & value; }
    uint8_t operator^=(int value) const { return *this = *this ^ value; }

private:
    unsigned long address_;
};

#ifndef REG8
#define REG8(address) vbus_reg8(address)
#endif
#ifndef MMIO8
#define MMIO8(address) vbus_reg8(address)
#endif
#ifndef HWREGB
#define HWREGB(address) vbus_reg8(address)
#endif
#ifndef _SFR_MEM8
#define _SFR_MEM8(address) vbus_reg8(address)
#endif

#endif

#endif
