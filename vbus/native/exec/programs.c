/* programs.c - starting other programs: what this one has held back goes to the bus before anything
 * of theirs. License: Apache-2.0.
 */
#define _GNU_SOURCE
#include "card.h"
#include "sys.h"
#include "trap.h"
#include "turns.h"

#include <alloca.h>
#include <spawn.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>

static void send_first(void)
{
    if (!card_in_use())
        return;
    card_enter();
    card_share();
    card_leave();
}

/* Before another program takes this one's place: what was said of its timers holds no more. */
static void leave(void)
{
    send_first();
    card_say_rest(NULL, 0);
}

PUBLIC int execve(const char *path, char *const arguments[], char *const variables[])
{
    REAL(execve);
    leave();
    return real(path, arguments, variables);
}

PUBLIC int execv(const char *path, char *const arguments[])
{
    REAL(execv);
    leave();
    return real(path, arguments);
}

PUBLIC int execvp(const char *file, char *const arguments[])
{
    REAL(execvp);
    leave();
    return real(file, arguments);
}

PUBLIC int execvpe(const char *file, char *const arguments[], char *const variables[])
{
    REAL(execvpe);
    leave();
    return real(file, arguments, variables);
}

PUBLIC int fexecve(int fd, char *const arguments[], char *const variables[])
{
    REAL(fexecve);
    leave();
    return real(fd, arguments, variables);
}

PUBLIC int execveat(int folder, const char *path, char *const arguments[], char *const variables[],
                    int flags)
{
    leave();
    return (int)syscall(SYS_execveat, folder, path, arguments, variables, flags);
}

/* The arguments of a list, as an array; `rest` stands behind the list afterwards. */
#define GATHER(first)                                                                              \
    char **arguments;                                                                              \
    size_t count = 1, turn;                                                                        \
    va_list rest;                                                                                  \
    va_start(rest, first);                                                                         \
    while (va_arg(rest, char *) != NULL)                                                           \
        count++;                                                                                   \
    va_end(rest);                                                                                  \
    arguments = alloca((count + 1) * sizeof *arguments);                                           \
    arguments[0] = (char *)first;                                                                  \
    va_start(rest, first);                                                                         \
    for (turn = 1; turn <= count; turn++)                                                          \
        arguments[turn] = va_arg(rest, char *)

PUBLIC int execl(const char *path, const char *first, ...)
{
    GATHER(first);
    va_end(rest);
    return execv(path, arguments);
}

PUBLIC int execlp(const char *file, const char *first, ...)
{
    GATHER(first);
    va_end(rest);
    return execvp(file, arguments);
}

PUBLIC int execle(const char *path, const char *first, ...)
{
    char *const *variables;
    GATHER(first);
    variables = va_arg(rest, char *const *);
    va_end(rest);
    return execve(path, arguments, variables);
}

PUBLIC int posix_spawn(pid_t *restrict child, const char *restrict path,
                       const posix_spawn_file_actions_t *actions,
                       const posix_spawnattr_t *restrict attributes,
                       char *const arguments[restrict], char *const variables[restrict])
{
    REAL(posix_spawn);
    send_first();
    return real(child, path, actions, attributes, arguments, variables);
}

PUBLIC int posix_spawnp(pid_t *restrict child, const char *restrict file,
                        const posix_spawn_file_actions_t *actions,
                        const posix_spawnattr_t *restrict attributes,
                        char *const arguments[restrict], char *const variables[restrict])
{
    REAL(posix_spawnp);
    send_first();
    return real(child, file, actions, attributes, arguments, variables);
}

PUBLIC int system(const char *command)
{
    int result;
    REAL(system);

    send_first();
    turns_go_out();
    result = real(command);
    turns_come_back();
    return result;
}

PUBLIC int pclose(FILE *stream)
{
    int result;
    REAL(pclose);

    turns_go_out();
    result = real(stream);
    turns_come_back();
    return result;
}

PUBLIC FILE *popen(const char *command, const char *mode)
{
    REAL(popen);
    send_first();
    return real(command, mode);
}

/* A child that shared this memory would take the session with it. */
PUBLIC pid_t vfork(void)
{
    return fork();
}
