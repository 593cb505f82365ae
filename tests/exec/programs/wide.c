/* A driver that copies structures from and to the card, as compilers make of it at -O2 and -O3; that
 * multiplies and divides by what it reads; and one whose divisor is 0.
 */
#include <fcntl.h>
#include <setjmp.h>
#include <signal.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <sys/mman.h>

struct block {
    uint32_t words[8];
};

static unsigned char *card;
static sigjmp_buf back;

static void on_division(int number, siginfo_t *info, void *data)
{
    (void)data;
    printf("signal %d, code %d, at the instruction %d\n", number, info->si_code,
           info->si_addr != NULL);
    siglongjmp(back, 1);
}

__attribute__((noinline)) static void copy(struct block *to, const struct block *from)
{
    *to = *from;
}

int main(int count, char **arguments)
{
    int fd = open("/dev/mem", O_RDWR | O_SYNC), turn;
    struct block mine, *theirs;
    struct sigaction action;
    uint64_t wide;
    double real = 0;
    uint32_t low, high = 0;

    card = mmap(NULL, 4096, PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0x40000000);
    if (fd < 0 || card == MAP_FAILED)
        return 1;
    theirs = (struct block *)(card + 0x20);
    for (turn = 0; turn < 8; turn++)
        mine.words[turn] = 0x03020100u + 0x04040404u * (unsigned)turn;
    copy(theirs, &mine);
    memset(&mine, 0, sizeof mine);
    copy(&mine, theirs);
    printf("structure %08x %08x\n", mine.words[0], mine.words[2]);
    __asm__ volatile("fildll %1; fistpll %0" : "=m"(wide) : "m"(theirs->words[0]));
    printf("fild %016llx\n", (unsigned long long)wide);
    __asm__ volatile("fldl %1; fstpl %0" : "=m"(real) : "m"(theirs->words[1]));
    memcpy(&wide, &real, sizeof wide);
    printf("fld %016llx\n", (unsigned long long)wide);
    low = 700;
    __asm__ volatile("divb %2; movzbl %%al, %0" : "+a"(low), "+d"(high) : "m"(card[0x23]) : "cc");
    printf("quotient %u\n", low);
    fflush(stdout);
    if (count > 1 && strcmp(arguments[1], "handled") == 0) {
        memset(&action, 0, sizeof action);
        action.sa_sigaction = on_division;
        action.sa_flags = SA_SIGINFO;
        sigaction(SIGFPE, &action, NULL);
    } else if (count > 1) {
        signal(SIGFPE, SIG_IGN); /* which the system does not heed */
    }
    if (sigsetjmp(back, 1) == 0) {
        __asm__ volatile("divl %2" : "+a"(low), "+d"(high) : "m"(theirs->words[1]) : "cc");
        printf("quotient %u\n", low);
        card[0x24] = card[0x25] = card[0x26] = card[0x27] = 0;
        fflush(stdout);
        __asm__ volatile("divl %2" : "+a"(low), "+d"(high) : "m"(theirs->words[1]) : "cc");
        printf("not reached\n");
    }
    return 0;
}
