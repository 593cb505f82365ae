/* main.c - a 68000 on VME that moves an axis by an LM629, and waits for its interrupts (level 4).
 *
 * The card has the chip on the odd bytes of short I/O: commands and status at FF8001h, data at
 * FF8003h. What the chip takes and gives has its high byte first, as this processor has it in memory:
 * structures go there and back byte for byte, and would be wrong on a little-endian computer.
 */
typedef unsigned char byte;
typedef unsigned short word;
typedef int number;

struct card {
    byte gap0, command; /* a read is the status */
    byte gap1, data;
};

struct serial { /* MC68681, odd bytes */
    struct { byte register_, gap; } r[16];
};

struct filter {
    word select, kp, ki, kd, il;
};

struct trajectory {
    word select;
    number acceleration, velocity, position;
} __attribute__((packed));

#define CARD ((volatile struct card *)0xFF8000)
#define SERIAL ((volatile struct serial *)0xFE0001)
#define STATUS 1
#define TRANSMIT 3
#define BUSY 0x01
#define COMPLETE 0x04
#define ERRORS 0x22 /* of position or command */
#define NEAR 6      /* counts */

enum { LFIL = 0x1E, UDF = 0x04, LTRJ = 0x1F, STT = 0x01, RDRP = 0x0A, MSKI = 0x1C, RSTI = 0x1D };

void sleep(void); /* until an interrupt has been served */

static volatile number interrupts;
static volatile byte came;

/* --- the console ------------------------------------------------------------------------------- */

static void put(byte c)
{
    while (!(SERIAL->r[STATUS].register_ & 0x04))
        ;
    SERIAL->r[TRANSMIT].register_ = c;
}

static void say(const char *text)
{
    while (*text != '\0')
        put((byte)*text++);
}

static void say_number(number value)
{
    static const number tens[] = { 100000, 10000, 1000, 100, 10, 1 };
    unsigned place, begun = 0;

    if (value < 0) {
        put('-');
        value = -value;
    }
    for (place = 0; place < 6; place++) {
        byte digit = '0';

        for (; value >= tens[place]; value -= tens[place])
            digit++;
        if (digit != '0' || begun || place == 5)
            put(digit);
        begun |= digit != '0';
    }
}

/* --- the chip ---------------------------------------------------------------------------------- */

static void wait(void)
{
    while (CARD->command & BUSY)
        ;
}

/* A command, and what it takes: the bytes of a structure, two at a time. */
static void send(byte command, const void *from, unsigned size)
{
    const byte *bytes = from;

    wait();
    CARD->command = command;
    for (; size; size -= 2) {
        wait();
        CARD->data = *bytes++;
        CARD->data = *bytes++;
    }
}

static number read_position(void)
{
    number position;
    byte *bytes = (byte *)&position;
    unsigned turn;

    send(RDRP, 0, 0);
    for (turn = 0; turn < 4; turn++) {
        if (turn % 2 == 0)
            wait();
        bytes[turn] = CARD->data;
    }
    return position;
}

/* Called by the interrupt: see why, and let the line go. */
void service(void)
{
    static const word none = 0;

    came = CARD->command;
    send(RSTI, &none, sizeof none);
    wait();
    interrupts++;
}

static void move(number target)
{
    struct trajectory way;
    number position;

    way.select = 0x002A;
    way.acceleration = 2150;
    way.velocity = 167772;
    way.position = target;
    send(LTRJ, &way, sizeof way);
    send(STT, 0, 0);
    do
        sleep();
    while (!(came & COMPLETE));
    position = read_position();
    say("position ");
    say_number(position);
    put('\n');
    if (position < target - NEAR || position > target + NEAR || came & ERRORS)
        say("failed\n");
}

number main(void)
{
    static const struct filter filter = { 0x000F, 200, 200, 2000, 20000 };
    static const word mask = COMPLETE, none = 0;

    wait();
    send(RSTI, &none, sizeof none);
    send(MSKI, &mask, sizeof mask);
    send(LFIL, &filter, sizeof filter);
    send(UDF, 0, 0);
    move(1000);
    move(-500);
    move(0);
    say_number(interrupts);
    say(" interrupts\n");
    return 0;
}
