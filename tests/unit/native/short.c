/* The C client where the system takes three bytes at a time. */
#ifndef _XOPEN_SOURCE
#define _XOPEN_SOURCE 700
#endif

#include <sys/socket.h>
#include <unistd.h>

#define send(fd, bytes, size, flags) send(fd, bytes, (size) < 3 ? (size) : 3, flags)
#define write(fd, bytes, size) write(fd, bytes, (size) < 3 ? (size) : 3)

#include "vbus.c"
