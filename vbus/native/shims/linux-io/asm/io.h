/* asm/io.h - as sys/io.h. License: Apache-2.0. */
#include <sys/io.h>
