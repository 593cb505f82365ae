/* Stream sockets by name: unix:PATH, or tcp:PORT of this computer. */
#include <arpa/inet.h>
#include <netinet/tcp.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>

static int is_socket(const char *place)
{
    return !strncmp(place, "unix:", 5) || !strncmp(place, "tcp:", 4);
}

/* Make a socket and its address; return its descriptor. */
static int socket_at(const char *place, struct sockaddr_storage *address, socklen_t *length)
{
    memset(address, 0, sizeof *address);
    if (!strncmp(place, "unix:", 5)) {
        struct sockaddr_un *local = (struct sockaddr_un *)address;
        local->sun_family = AF_UNIX;
        strncpy(local->sun_path, place + 5, sizeof local->sun_path - 1);
        *length = sizeof *local;
        return socket(AF_UNIX, SOCK_STREAM, 0);
    }
    struct sockaddr_in *near = (struct sockaddr_in *)address;
    near->sin_family = AF_INET;
    near->sin_port = htons((unsigned short)atoi(place + 4));
    near->sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    *length = sizeof *near;
    return socket(AF_INET, SOCK_STREAM, 0);
}

/* Send at once what is written to a TCP socket; others have no such delay. */
static int prompt(int fd)
{
    int yes = 1;
    setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &yes, sizeof yes);
    return fd;
}
