/* Everything threads wait for of each other, one after the other. The card is an MCP-1200: R20h to
 * R27h keep bytes.
 */
#define _GNU_SOURCE
#include <errno.h>
#include <linux/futex.h>
#include <pthread.h>
#include <semaphore.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/io.h>
#include <sys/syscall.h>
#include <threads.h>
#include <time.h>
#include <unistd.h>

#define KEEP 0x320

static pthread_mutex_t mutex = PTHREAD_MUTEX_INITIALIZER;
static pthread_cond_t condition = PTHREAD_COND_INITIALIZER;
static pthread_rwlock_t rwlock = PTHREAD_RWLOCK_INITIALIZER;
static pthread_once_t once = PTHREAD_ONCE_INIT;
static pthread_barrier_t barrier;
static pthread_spinlock_t spinlock;
static sem_t semaphores[3];
static volatile int count, readers, most, writers, cleaned;
static volatile uint32_t word;
static char order[16];

static void *count_up(void *data)
{
    int turn;

    for (turn = 0; turn < 10000; turn++) {
        pthread_mutex_lock(&mutex);
        count = count + 1;
        if (turn % 1000 == 0)
            inb(KEEP);
        pthread_mutex_unlock(&mutex);
    }
    return data;
}

static void *in_order(void *data)
{
    int own = (int)(intptr_t)data, turn;

    for (turn = 0; turn < 3; turn++) {
        sem_wait(&semaphores[own]);
        order[strlen(order)] = (char)('a' + own);
        inb(KEEP);
        sem_post(&semaphores[(own + 1) % 3]);
    }
    return NULL;
}

static void *meet(void *data)
{
    (void)data;
    usleep(1000);
    return (void *)(intptr_t)(pthread_barrier_wait(&barrier) == PTHREAD_BARRIER_SERIAL_THREAD);
}

static void begin_once(void)
{
    inb(KEEP);
    usleep(1000);
    count++;
}

static void *call_it(void *data)
{
    pthread_once(&once, begin_once);
    return data;
}

static void *read_it(void *data)
{
    pthread_rwlock_rdlock(&rwlock);
    __atomic_add_fetch(&readers, 1, __ATOMIC_SEQ_CST);
    pthread_barrier_wait(&barrier);
    most = readers;
    pthread_barrier_wait(&barrier);
    __atomic_sub_fetch(&readers, 1, __ATOMIC_SEQ_CST);
    pthread_rwlock_unlock(&rwlock);
    return data;
}

static void *write_it(void *data)
{
    pthread_rwlock_wrlock(&rwlock);
    writers = readers == 0;
    pthread_rwlock_unlock(&rwlock);
    return data;
}

static mtx_t c11_mutex;
static cnd_t c11_condition;

static int c11(void *data)
{
    struct timespec pause = {0, 1000000};

    (void)data;
    thrd_sleep(&pause, NULL);
    mtx_lock(&c11_mutex);
    count = 1;
    cnd_signal(&c11_condition);
    mtx_unlock(&c11_mutex);
    return 2;
}

static void unlock(void *data)
{
    pthread_mutex_unlock(data);
}

static void clean(void *data)
{
    (void)data;
    cleaned++;
}

static void *endless(void *data)
{
    const char *how = data;

    pthread_cleanup_push(clean, NULL);
    sem_post(&semaphores[0]);
    if (strcmp(how, "access") == 0)
        pthread_setcanceltype(PTHREAD_CANCEL_ASYNCHRONOUS, NULL);
    if (strcmp(how, "condition") == 0) {
        pthread_mutex_lock(&mutex);
        pthread_cleanup_push(unlock, &mutex);
        for (;;)
            pthread_cond_wait(&condition, &mutex);
        pthread_cleanup_pop(1);
    }
    for (;;)
        if (strcmp(how, "access") == 0)
            inb(KEEP);
        else
            sleep(1000);
    pthread_cleanup_pop(0);
    return NULL;
}

static void cancel_in(const char *how)
{
    pthread_t thread;
    void *result;

    cleaned = 0;
    sem_init(&semaphores[0], 0, 0);
    pthread_create(&thread, NULL, endless, (void *)how);
    sem_wait(&semaphores[0]);
    usleep(5000);
    pthread_cancel(thread);
    pthread_join(thread, &result);
    printf("cancelled %d in %s\n", result == PTHREAD_CANCELED && cleaned, how);
}

/* An access is no point at which a thread may be cancelled. */
static void *cancel_itself(void *data)
{
    pthread_cancel(pthread_self());
    inb(KEEP);
    cleaned = 1;
    pthread_testcancel();
    return data;
}

static void *wait_for(void *data)
{
    sem_wait(data);
    return NULL;
}

static void *leave(void *data)
{
    inb(KEEP);
    pthread_exit(data);
}

static void *post_later(void *data)
{
    usleep(1000);
    sem_post(data);
    return NULL;
}

static void *wake(void *data)
{
    usleep(1000);
    word = 1;
    syscall(SYS_futex, &word, FUTEX_WAKE_PRIVATE, 1, NULL, NULL, 0);
    return data;
}

static void *spin_up(void *data)
{
    int turn;

    for (turn = 0; turn < 1000; turn++) {
        pthread_spin_lock(&spinlock);
        count = count + 1;
        pthread_spin_unlock(&spinlock);
    }
    return data;
}

static void run(void *(*routine)(void *), int number, intptr_t *sum)
{
    pthread_t threads[4];
    int turn;

    count = 0;
    for (turn = 0; turn < number; turn++)
        pthread_create(&threads[turn], NULL, routine, (void *)(intptr_t)turn);
    for (turn = 0; turn < number; turn++) {
        void *result = NULL;

        pthread_join(threads[turn], &result);
        if (sum != NULL)
            *sum += (intptr_t)result;
    }
}

int main(void)
{
    struct timespec until;
    pthread_attr_t attributes;
    pthread_t thread, others[2];
    intptr_t sum = 0;
    void *result;
    thrd_t c11_thread;
    int turn, c11_result = 0, error;

    if (iopl(3) != 0)
        return 1;
    inb(KEEP);
    run(count_up, 2, NULL);
    printf("mutex %d of 20000\n", count);
    for (turn = 0; turn < 3; turn++)
        sem_init(&semaphores[turn], 0, turn == 0);
    run(in_order, 3, NULL);
    printf("order %s\n", order);
    pthread_barrier_init(&barrier, NULL, 3);
    run(meet, 3, &sum);
    printf("barrier %d serial of 3\n", sum == 0 ? 0 : 1);
    run(call_it, 3, NULL);
    printf("once %d\n", count);
    pthread_barrier_init(&barrier, NULL, 2);
    pthread_create(&others[0], NULL, read_it, NULL);
    pthread_create(&others[1], NULL, read_it, NULL);
    pthread_create(&thread, NULL, write_it, NULL);
    pthread_join(others[0], NULL);
    pthread_join(others[1], NULL);
    pthread_join(thread, NULL);
    printf("rwlock %d readers, then %d writer\n", most, writers);
    count = 0;
    mtx_init(&c11_mutex, mtx_plain);
    cnd_init(&c11_condition);
    thrd_create(&c11_thread, c11, NULL);
    mtx_lock(&c11_mutex);
    while (count == 0)
        cnd_wait(&c11_condition, &c11_mutex);
    mtx_unlock(&c11_mutex);
    thrd_join(c11_thread, &c11_result);
    printf("c11 %d\n", count + c11_result);
    sem_init(&semaphores[1], 0, 0);
    pthread_create(&thread, NULL, wait_for, &semaphores[1]);
    clock_gettime(CLOCK_REALTIME, &until);
    error = pthread_timedjoin_np(thread, NULL, &until);
    sem_post(&semaphores[1]);
    printf("timed join %d, then %d\n", error, pthread_join(thread, NULL));
    cancel_in("sleep");
    cancel_in("condition");
    cancel_in("access");
    cleaned = 0;
    pthread_create(&thread, NULL, cancel_itself, NULL);
    pthread_join(thread, &result);
    inb(KEEP);
    printf("cancelled %d after an access\n", result == PTHREAD_CANCELED && cleaned);
    pthread_create(&thread, NULL, leave, (void *)5);
    pthread_join(thread, &result);
    printf("left by exit %d\n", (int)(intptr_t)result);
    sem_init(&semaphores[2], 0, 0);
    pthread_create(&thread, NULL, post_later, &semaphores[2]);
    error = sem_wait(&semaphores[2]);
    pthread_join(thread, NULL);
    printf("semaphores %d\n", error == 0 ? 3 : errno);
    pthread_create(&thread, NULL, wake, NULL);
    while (word == 0 && error == 0)
        if (syscall(SYS_futex, &word, FUTEX_WAIT_PRIVATE, 0, NULL, NULL, 0) && errno != EAGAIN)
            error = errno;
    pthread_join(thread, NULL);
    printf("futex %d\n", error);
    pthread_spin_init(&spinlock, 0);
    run(spin_up, 2, NULL);
    printf("spinlock %d\n", count);
    sem_init(&semaphores[2], 0, 0);
    pthread_attr_init(&attributes);
    pthread_attr_setdetachstate(&attributes, PTHREAD_CREATE_DETACHED);
    pthread_create(&thread, &attributes, post_later, &semaphores[2]);
    printf("detached %d\n", sem_wait(&semaphores[2]) == 0);
    return 0;
}
