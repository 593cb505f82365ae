/* One wait a driver may use, by name: how it ends by time, or by the interrupt's signal (SIGIO). The
 * card is an LM629 at 340h whose HI interrupts.
 *
 *     each_wait NAME time      waits 20 ms; prints what came of it, and how long it took (0.1 ms)
 *     each_wait NAME signal    starts a move that interrupts after 60 ms, and waits for longer
 *     each_wait NAME later     every 200 ms: in real time one comes after the wait has begun
 */
#define _GNU_SOURCE
#include <errno.h>
#include <fcntl.h>
#include <linux/futex.h>
#include <mqueue.h>
#include <poll.h>
#include <pthread.h>
#include <semaphore.h>
#include <signal.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/ipc.h>
#include <sys/sem.h>
#include <sys/select.h>
#include <sys/signalfd.h>
#include <sys/syscall.h>
#include <sys/time.h>
#include <sys/timerfd.h>
#include <threads.h>
#include <time.h>
#include <unistd.h>

#include "lm629.h"

static volatile sig_atomic_t signals;
static int seconds; /* 0: 20 ms */
static sigset_t only;

static void on_signal(int number)
{
    (void)number;
    signals = signals + 1;
}

static void prepare(unsigned length)
{
    ready();
    outb(0, BASE); /* RESET: another program may have been here */
    while ((inb(BASE) & 0xBF) != 0x84)
        ;
    load_move(200, length);
}

static long long now(void)
{
    struct timespec when;

    clock_gettime(CLOCK_MONOTONIC, &when);
    return (long long)when.tv_sec * 1000000000 + when.tv_nsec;
}

static struct timespec longest(void)
{
    struct timespec time = {seconds, seconds ? 0 : 20000000};

    return time;
}

static struct timespec until(clockid_t clock)
{
    struct timespec when, more = longest();

    clock_gettime(clock, &when);
    when.tv_sec += more.tv_sec;
    when.tv_nsec += more.tv_nsec;
    if (when.tv_nsec >= 1000000000) {
        when.tv_sec++;
        when.tv_nsec -= 1000000000;
    }
    return when;
}

/* 0 or -1 and errno, of a function that returns an error number. */
static int as_errno(int error)
{
    errno = error;
    return error == 0 ? 0 : -1;
}

static void *hold(void *mutex)
{
    pthread_mutex_lock(mutex);
    sem_post((sem_t *)((char *)mutex + sizeof(pthread_mutex_t)));
    sleep(1000);
    return NULL;
}

static struct {
    pthread_mutex_t mutex;
    sem_t held;
} other = {.mutex = PTHREAD_MUTEX_INITIALIZER};

static pthread_t in_another(void *(*routine)(void *), void *data)
{
    sigset_t all, before;
    pthread_t thread;

    sigfillset(&all);
    pthread_sigmask(SIG_SETMASK, &all, &before); /* the signal is for the main thread */
    pthread_create(&thread, NULL, routine, data);
    pthread_sigmask(SIG_SETMASK, &before, NULL);
    return thread;
}

static void *write_lock(void *lock)
{
    pthread_rwlock_wrlock(lock);
    sem_post(&other.held);
    sleep(1000);
    return NULL;
}

static void on_alarm(union sigval value)
{
    sem_post(value.sival_ptr);
}

/* Each reset interrupts. */
static void *interrupt(void *data)
{
    for (;;) {
        usleep(200000);
        prepare(40);
    }
    return data;
}

static int wait_by(const char *name)
{
    struct timespec time = longest(), real = until(CLOCK_REALTIME), monotonic = until(CLOCK_MONOTONIC);
    struct timeval time_val = {time.tv_sec, time.tv_nsec / 1000};
    struct itimerval interval = {{0, 0}, time_val};
    struct itimerspec spec = {{0, 0}, time};
    struct sigevent event;
    struct epoll_event found;
    struct signalfd_siginfo told;
    struct mq_attr attributes = {0, 1, 8, 0, {0}};
    int pipes[2], fd, ms = (int)(time.tv_sec * 1000 + time.tv_nsec / 1000000), number;
    static pthread_cond_t condition = PTHREAD_COND_INITIALIZER;
    static pthread_mutex_t mutex = PTHREAD_MUTEX_INITIALIZER;
    static pthread_rwlock_t rwlock = PTHREAD_RWLOCK_INITIALIZER;
    static uint32_t word;
    struct sembuf take = {0, -1, 0};
    char text[64];
    siginfo_t info;
    struct pollfd set;
    sigset_t none;
    timer_t timer;
    uint64_t count;
    mqd_t queue;
    fd_set in;
    sem_t semaphore;
    int result;

    sigemptyset(&none);
    sem_init(&semaphore, 0, 0);
    sem_init(&other.held, 0, 0);
    if (pipe(pipes) != 0)
        return -2;
    set.fd = pipes[0];
    set.events = POLLIN;
    FD_ZERO(&in);
    FD_SET(pipes[0], &in);
    memset(&event, 0, sizeof event);
#define IS(text) (strcmp(name, text) == 0)
    if (IS("nanosleep"))
        return nanosleep(&time, NULL);
    if (IS("clock_nanosleep"))
        return as_errno(clock_nanosleep(CLOCK_MONOTONIC, 0, &time, NULL));
    if (IS("clock_nanosleep until"))
        return as_errno(clock_nanosleep(CLOCK_REALTIME, TIMER_ABSTIME, &real, NULL));
    if (IS("usleep"))
        return usleep((useconds_t)ms * 1000);
    if (IS("sleep"))
        return sleep((unsigned)time.tv_sec) > 0 ? as_errno(EINTR) : 0;
    if (IS("thrd_sleep"))
        return thrd_sleep(&time, NULL) == 0 ? 0 : as_errno(EINTR);
    if (IS("select"))
        return select(pipes[0] + 1, &in, NULL, NULL, &time_val);
    if (IS("select of nothing"))
        return select(0, NULL, NULL, NULL, &time_val);
    if (IS("pselect"))
        return pselect(pipes[0] + 1, &in, NULL, NULL, &time, &none);
    if (IS("poll"))
        return poll(&set, 1, ms);
    if (IS("ppoll"))
        return ppoll(&set, 1, &time, &none);
    fd = epoll_create1(0);
    if (IS("epoll_wait"))
        return epoll_wait(fd, &found, 1, ms);
    if (IS("epoll_pwait"))
        return epoll_pwait(fd, &found, 1, ms, &none);
    if (IS("read of a pipe"))
        return (int)read(pipes[0], text, 1);
    if (IS("sigtimedwait"))
        return sigtimedwait(&only, &info, &time);
    if (IS("sigwaitinfo"))
        return sigwaitinfo(&only, &info);
    if (IS("sigwait"))
        return sigwait(&only, &number) == 0 ? number : -1;
    if (IS("signalfd")) {
        fd = signalfd(-1, &only, 0);
        return read(fd, &told, sizeof told) == sizeof told ? (int)told.ssi_signo : -1;
    }
    if (IS("poll of a signalfd")) {
        set.fd = signalfd(-1, &only, 0);
        return poll(&set, 1, ms);
    }
    if (IS("pause"))
        return pause();
    if (IS("sigsuspend"))
        return sigsuspend(&none);
    if (IS("futex"))
        return (int)syscall(SYS_futex, &word, FUTEX_WAIT_PRIVATE, 0, &time, NULL, 0);
    if (IS("sem_timedwait"))
        return sem_timedwait(&semaphore, &real);
    if (IS("sem_clockwait"))
        return sem_clockwait(&semaphore, CLOCK_MONOTONIC, &monotonic);
    if (IS("pthread_cond_timedwait")) {
        pthread_mutex_lock(&mutex);
        do
            result = pthread_cond_timedwait(&condition, &mutex, &real);
        while (result == 0);
        return as_errno(result);
    }
    if (IS("pthread_mutex_timedlock")) {
        in_another(hold, &other.mutex);
        while (sem_wait(&other.held) != 0) /* the signal may come here in real time */
            ;
        real = until(CLOCK_REALTIME);
        return as_errno(pthread_mutex_timedlock(&other.mutex, &real));
    }
    if (IS("pthread_rwlock_timedrdlock")) {
        in_another(write_lock, &rwlock);
        while (sem_wait(&other.held) != 0) /* the signal may come here in real time */
            ;
        real = until(CLOCK_REALTIME);
        return as_errno(pthread_rwlock_timedrdlock(&rwlock, &real));
    }
    if (IS("pthread_timedjoin_np"))
        return as_errno(pthread_timedjoin_np(in_another(hold, &other.mutex), NULL, &real));
    if (IS("mq_timedreceive") || IS("mq_timedsend")) {
        snprintf(text, sizeof text, "/each_wait.%d", (int)getpid());
        queue = mq_open(text, O_RDWR | O_CREAT, 0600, &attributes);
        mq_unlink(text);
        if (IS("mq_timedreceive"))
            return (int)mq_timedreceive(queue, text, 8, NULL, &real);
        mq_send(queue, "x", 1, 0);
        return mq_timedsend(queue, "y", 1, 0, &real);
    }
    if (IS("semtimedop"))
        return semtimedop(semget(IPC_PRIVATE, 1, 0600), &take, 1, &time);
    if (IS("setitimer")) {
        setitimer(ITIMER_REAL, &interval, NULL);
        return sigsuspend(&none);
    }
    if (IS("alarm")) {
        alarm((unsigned)time.tv_sec);
        return sigsuspend(&none);
    }
    if (IS("timer_create")) {
        event.sigev_notify = SIGEV_SIGNAL;
        event.sigev_signo = SIGALRM;
        timer_create(CLOCK_MONOTONIC, &event, &timer);
        timer_settime(timer, 0, &spec, NULL);
        return sigsuspend(&none);
    }
    if (IS("timer with a thread")) {
        event.sigev_notify = SIGEV_THREAD;
        event.sigev_notify_function = on_alarm;
        event.sigev_value.sival_ptr = &semaphore;
        timer_create(CLOCK_REALTIME, &event, &timer);
        timer_settime(timer, 0, &spec, NULL);
        return sem_wait(&semaphore);
    }
    if (IS("timerfd")) {
        fd = timerfd_create(CLOCK_MONOTONIC, 0);
        timerfd_settime(fd, 0, &spec, NULL);
        return read(fd, &count, sizeof count) == 8 ? (int)count : -1;
    }
    return -2;
}

int main(int argc, char **arguments)
{
    int later = argc > 2 && strcmp(arguments[2], "later") == 0;
    int by_signal = later || (argc > 2 && strcmp(arguments[2], "signal") == 0), result, error;
    struct sigaction action;
    sigset_t alarms;
    long long start, took;

    if (argc < 3 || ioperm(BASE, 2, 1) != 0)
        return 1;
    memset(&action, 0, sizeof action);
    action.sa_handler = on_signal;
    sigaction(SIGALRM, &action, NULL);
    sigemptyset(&alarms);
    sigaddset(&alarms, SIGALRM);
    sigprocmask(SIG_BLOCK, &alarms, NULL); /* in real time it may come before the wait */
    if (!by_signal)
        action.sa_handler = SIG_IGN; /* in real time that of the reset may come late */
    sigaction(SIGIO, &action, NULL);
    sigemptyset(&only);
    sigaddset(&only, by_signal ? SIGIO : SIGUSR1);
    prepare(40);
    if (strncmp(arguments[1], "sig", 3) == 0 || strstr(arguments[1], "signalfd") != NULL)
        if (strcmp(arguments[1], "sigsuspend") != 0)
            sigprocmask(SIG_BLOCK, &only, NULL);
    if (by_signal)
        seconds = strncmp(arguments[1], "pthread_", 8) == 0 ? 1 : 100;
    else
        seconds = strcmp(arguments[1], "sleep") == 0 || strcmp(arguments[1], "alarm") == 0;
    signals = 0;
    if (later)
        in_another(interrupt, NULL);
    else if (by_signal)
        command(0x01, 0, NULL); /* STT */
    start = now();
    result = wait_by(arguments[1]);
    error = errno;
    took = now() - start;
    while (later && result == -1 && !signals) /* a wait that no signal ends was over before one came */
        usleep(1000);
    printf("%d %s, signals %d", result, result == -1 ? strerrorname_np(error) : "-",
           later ? signals > 0 : (int)signals);
    if (by_signal)
        printf(", %s\n", took < 10000000000 ? "at once" : "late");
    else
        printf(", %lld.%lld ms\n", took / 1000000, took / 100000 % 10);
    fflush(stdout);
    _exit(0);
}
