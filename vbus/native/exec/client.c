/* client.c - the C client, its system calls made directly: no thread is cancelled in the middle of a
 * cycle, where the C library's functions would let it end or wait. License: Apache-2.0.
 */
#define _GNU_SOURCE
#include "sys.h"

#include <errno.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sched.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <termios.h>

#define open(path, flags) sys_open(path, flags)
#define close(fd) sys_close(fd)
#define read(fd, data, size) sys_read(fd, data, size)
#define write(fd, data, size) sys_write(fd, data, size)
#define poll(set, count, timeout) sys_poll(set, count, timeout)
#define send(fd, data, size, flags) syscall(SYS_sendto, fd, data, size, flags, NULL, 0)
#define recv(fd, data, size, flags) syscall(SYS_recvfrom, fd, data, size, flags, NULL, NULL)
#define sched_yield() syscall(SYS_sched_yield)
#define connect(fd, address, size) (int)syscall(SYS_connect, fd, address, size)
#define clock_gettime(clock, when) sys_clock_gettime(clock, when)

#include "../vbus.c"
