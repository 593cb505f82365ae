/* Waits in one of several ways, after an access to the card if it has one: for what cannot come, or for
 * what will. */
#include <fcntl.h>
#include <poll.h>
#include <pthread.h>
#include <sched.h>
#include <semaphore.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/io.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

static pthread_mutex_t mutex = PTHREAD_MUTEX_INITIALIZER;
static pthread_cond_t condition = PTHREAD_COND_INITIALIZER;
static volatile int sink;

static void on_alarm(int number)
{
    (void)number;
}

__attribute__((noinline)) static void *lock_twice(void *argument)
{
    pthread_mutex_lock(&mutex);
    pthread_mutex_lock(&mutex);
    sink++;
    return argument;
}

static void *come_later(void *argument)
{
    struct timespec wait = {1, 0};

    nanosleep(&wait, NULL);
    pthread_mutex_lock(&mutex);
    sink = 1;
    pthread_cond_broadcast(&condition);
    pthread_mutex_unlock(&mutex);
    return argument;
}

int main(int argc, char **argv)
{
    const char *how = argv[1];
    struct pollfd set;
    struct timespec soon;
    pthread_t thread;
    sem_t semaphore;
    char byte;
    int ends[2];

    if (argc > 2 && (ioperm(0x340, 2, 1) != 0 || inb(0x340) == 0x01))
        return 3;
    printf("begun\n");
    fflush(stdout);
    sem_init(&semaphore, 0, 0);
    if (pipe(ends) != 0)
        return 3;
    set = (struct pollfd){ends[0], POLLIN, 0};
    if (strcmp(how, "mutex") == 0)
        lock_twice(NULL);
    if (strcmp(how, "join") == 0 && pthread_create(&thread, NULL, lock_twice, NULL) == 0)
        pthread_join(thread, NULL);
    if (strcmp(how, "semaphore") == 0)
        sem_wait(&semaphore);
    if (strcmp(how, "condition") == 0) {
        pthread_mutex_lock(&mutex);
        pthread_cond_wait(&condition, &mutex);
    }
    if (strcmp(how, "pipe") == 0)
        return read(ends[0], &byte, 1) == 1;
    if (strcmp(how, "poll") == 0)
        poll(&set, 1, -1);
    if (strcmp(how, "pause") == 0)
        pause();
    if (strcmp(how, "child") == 0) {
        if (fork() == 0)
            pause();
        wait(NULL);
    }
    if (strcmp(how, "computes") == 0)
        for (;;)
            ;
    if (strcmp(how, "yields") == 0)
        while (!sink)
            sched_yield();
    /* --- and what comes --- */
    if (strcmp(how, "sleeps") == 0)
        sleep(1);
    if (strcmp(how, "working child") == 0) {
        if (fork() == 0) {
            sleep(1);
            _exit(0);
        }
        wait(NULL);
    }
    if (strcmp(how, "child writes") == 0) {
        if (fork() == 0) {
            sleep(1);
            _exit(write(ends[1], "x", 1) != 1);
        }
        if (read(ends[0], &byte, 1) != 1)
            return 4;
        wait(NULL);
    }
    if (strcmp(how, "alarm") == 0) {
        signal(SIGALRM, on_alarm);
        alarm(1);
        pause();
    }
    if (strcmp(how, "thread works") == 0 && pthread_create(&thread, NULL, come_later, NULL) == 0) {
        pthread_mutex_lock(&mutex);
        while (!sink)
            pthread_cond_wait(&condition, &mutex);
        pthread_mutex_unlock(&mutex);
        pthread_join(thread, NULL);
    }
    if (strcmp(how, "timed") == 0) {
        clock_gettime(CLOCK_REALTIME, &soon);
        soon.tv_sec++;
        sem_timedwait(&semaphore, &soon);
    }
    if (strcmp(how, "stdin") == 0)
        return read(0, &byte, 1) != 1;
    return 0;
}
