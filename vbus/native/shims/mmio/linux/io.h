/* linux/io.h - accesses to memory-mapped chips. License: Apache-2.0. */
#include "vbus_mmio.h"
