/* Threads that print in which order they had their turns, or write. The card is an MCP-1200.
 *
 *     takes_turns begins    six threads begin, and access the card twice
 *     takes_turns asks      one asks again and again for a child that lives, beside one at the card
 *     takes_turns prints    one prints more than a pipe holds, beside one at the card
 *     takes_turns writes    one writes for ever, and the first waits for it
 */
#include <pthread.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <sys/io.h>
#include <sys/wait.h>
#include <unistd.h>

#define KEEP 0x320

static char order[64];

static void note(char name)
{
    order[strlen(order)] = name;
    inb(KEEP);
}

static void *begins(void *data)
{
    note((char)(intptr_t)data);
    note((char)(intptr_t)data);
    return NULL;
}

static void *prints(void *data)
{
    int turn;

    note('a');
    for (turn = 0; turn < 20000; turn++)
        puts("0123456789");
    note('a');
    return data;
}

static void *asks(void *data)
{
    int turn;

    for (turn = 0; turn < 6 && waitpid(-1, NULL, WNOHANG) == 0; turn++)
        note('a');
    return data;
}

static void *writes(void *data)
{
    for (;;)
        outb(0x0D, KEEP);
    return data;
}

int main(int count, char **arguments)
{
    pthread_t threads[6];
    int turn, ends[2];
    char byte;

    if (count < 2 || iopl(3) != 0 || pipe(ends) != 0)
        return 1;
    inb(KEEP);
    if (strcmp(arguments[1], "begins") == 0) {
        for (turn = 0; turn < 6; turn++)
            pthread_create(&threads[turn], NULL, begins, (void *)(intptr_t)('a' + turn));
        for (turn = 0; turn < 6; turn++)
            pthread_join(threads[turn], NULL);
    } else if (strcmp(arguments[1], "prints") == 0) {
        pthread_create(&threads[0], NULL, prints, NULL);
        for (turn = 0; turn < 6; turn++)
            note('m');
        pthread_join(threads[0], NULL);
    } else if (strcmp(arguments[1], "writes") == 0) {
        pthread_create(&threads[0], NULL, writes, NULL);
        pthread_join(threads[0], NULL);
    } else {
        if (fork() == 0) {
            close(ends[1]);
            _exit((int)read(ends[0], &byte, 1));
        }
        pthread_create(&threads[0], NULL, asks, NULL);
        for (turn = 0; turn < 12; turn++)
            note('m');
        pthread_join(threads[0], NULL);
        close(ends[1]);
        wait(NULL);
    }
    puts(order);
    return 0;
}
