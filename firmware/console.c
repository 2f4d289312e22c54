/* The reference on a terminal: one command per line on stdin, its answers and then "." on stdout.
 *
 * It begins with the answers to "new 4096". For the tests, which drive it with the same frames as the host's codec, and for trying things by
 * hand. Numbers are decimal, octets hexadecimal ("-": none), times microseconds.
 *
 *   crc HEX | cobs HEX | uncobs HEX | encode KIND SEQUENCE HEX
 *   decode HEX      feed a stream to a frame decoder of its own; `forget` starts it anew
 *   counts          good, bad_cobs, too_short, too_long, bad_crc, wrong_version
 *   new RECORDS [latched COUNT | forgetful]
 *                   a new device whose ring has room for RECORDS; it was never stopped, or is
 *                   latched by stop COUNT, of `ada`, or has no lasting memory
 *   reset | wipe    power off and on: with what it remembers, or with its memory gone
 *   cut COUNT | fill COUNT OCTET
 *                   power off and on: with the first octets of its memory alone, or with an OCTET
 *                   in place of each of them
 *   memory 0|1      whether remembering works
 *   receive TIME HEX | tick TIME
 *   samples FIRST COUNT HEX | event SECONDS HEX | finish OUTCOME FAULT HEX
 *   rest 0|1 | persists 0|1     what the axis, and the cause of a fault, do
 *
 * Besides "sent" the answers are what the device had the application do, in its order: "set",
 * "drive on", "brake", "drive off", "remember LATCHED COUNT CAUSE WHO" and, after that, "failed".
 *   limits HEX      f64 angle, rate, rate_time, torque, current, sample rate: watch a new trial
 *   measured HEX    f64 angle, rate, torque, current of each sample: the verdicts until the last
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "campaign_limits.h"
#include "campaign_state.h"

#define MOST_RECORDS 4096u
#define MOST_RATES 4096u
#define LONGEST_LINE (1u << 21)

static char line[LONGEST_LINE];
static campaign_octet octets[LONGEST_LINE];
static struct campaign_record ring[MOST_RECORDS];
static struct campaign_device device;
static struct campaign_decoder decoder;
static bool drive, rest, persists;

/* What outlives a reset: latched u8, count u32, cause u8, by short, CRC-32 of all that. */
static campaign_octet memory[1u + 4u + 1u + 1u + CAMPAIGN_LONGEST_HOST + 4u];
static size_t memory_used;
static bool memory_works;
static unsigned long records_kept;

static void print_octets(const campaign_octet *data, size_t count)
{
    static const char digits[] = "0123456789abcdef";
    if (count == 0)
        putchar('-');
    for (size_t i = 0; i < count; i++) {
        putchar(digits[data[i] >> 4 & 0xF]);
        putchar(digits[data[i] & 0xF]);
    }
}

static void print_line(const char *word, const campaign_octet *data, size_t count)
{
    printf("%s ", word);
    print_octets(data, count);
    putchar('\n');
}

static int digit(char c)
{
    if (c >= '0' && c <= '9')
        return c - '0';
    return c >= 'a' && c <= 'f' ? c - 'a' + 10 : -1;
}

static size_t read_octets(const char *text)
{
    size_t count = 0;
    while (text != NULL && digit(text[0]) >= 0 && digit(text[1]) >= 0) {
        octets[count++] = (campaign_octet)(digit(text[0]) * 16 + digit(text[1]));
        text += 2;
    }
    return count;
}

static const char *read_text(const char *text)
{
    octets[read_octets(text)] = 0;
    return (const char *)octets;
}

/* Hooks: an axis that obeys at once, unless `rest` says that it still moves. */

static void on_send(void *context, const campaign_octet *data, size_t count)
{
    (void)context;
    print_line("sent", data, count);
}

static struct campaign_refusal on_set(void *context, const struct campaign_item *item, bool commit)
{
    struct campaign_refusal refusal = {CAMPAIGN_ACCEPTED, NULL};
    (void)context;
    if (strncmp(item->name, "unknown.", 8) == 0) {
        refusal.code = CAMPAIGN_UNKNOWN_NAME;
        refusal.text = "no such parameter";
    }
    if (!commit)
        return refusal;
    printf("set %s %d ", item->name, (int)item->tag);
    if (item->tag == CAMPAIGN_F64)
        printf("%.17g", item->f64);
    else if (item->tag == CAMPAIGN_I64)
        printf("%llu", (unsigned long long)item->i64);
    else if (item->tag == CAMPAIGN_BOOL)
        printf("%d", item->truth);
    else if (item->tag == CAMPAIGN_TEXT)
        print_octets(item->text, item->text_length);
    else
        printf("%lu %lu", (unsigned long)item->total, (unsigned long)item->offset);
    for (uint32_t i = 0; i < item->count; i++)
        printf(" %.17g", item->values[i]);
    putchar('\n');
    return refusal;
}

static void on_clear(void *context)
{
    (void)context;
}

static struct campaign_refusal on_arm(void *context)
{
    struct campaign_refusal refusal = {CAMPAIGN_ACCEPTED, NULL};
    (void)context;
    if (!rest) {
        refusal.code = CAMPAIGN_NOT_READY;
        refusal.text = "the axis is not at rest";
    }
    return refusal;
}

static const struct campaign_channel *on_channels(void *context, size_t *count, double *rate)
{
    static const struct campaign_channel channels[] = {
        {"gyro_rate", "rad/s", "deg/s", "Rate of the load", true, CAMPAIGN_FORMAT_F64, 1.0},
        {"motor_current", "A", "A", "Motor current", true, CAMPAIGN_FORMAT_I16, 0.001},
    };
    (void)context;
    *count = sizeof channels / sizeof *channels;
    *rate = 1000.0;
    return channels;
}

static void on_start(void *context)
{
    (void)context;
    puts("drive on");
    drive = true;
}

static void on_stop(void *context)
{
    (void)context;
    puts("brake");
}

static void on_drive_off(void *context)
{
    (void)context;
    puts("drive off");
    drive = false;
}

static bool is_drive_on(void *context)
{
    (void)context;
    return drive;
}

static bool is_at_rest(void *context)
{
    (void)context;
    return rest;
}

static bool does_fault_persist(void *context)
{
    (void)context;
    return persists;
}

static double get_temperature(void *context)
{
    (void)context;
    return 25.0;
}

static void write_memory(const struct campaign_latch *latch)
{
    struct campaign_writer writer = {memory, sizeof memory, 0, false};
    campaign_put_u8(&writer, latch->latched);
    campaign_put_u32(&writer, latch->count);
    campaign_put_u8(&writer, latch->cause);
    campaign_put_short(&writer, latch->by);
    campaign_put_u32(&writer, campaign_crc32(0, memory, writer.used));
    memory_used = writer.used;
}

/* False for a memory that does not say for certain what was remembered. */
static bool read_memory(struct campaign_latch *latch)
{
    struct campaign_reader reader = {memory, memory_used, 0, false};
    size_t length = 0, end;
    const campaign_octet *by;
    latch->latched = campaign_get_u8(&reader) != 0;
    latch->count = campaign_get_u32(&reader);
    latch->cause = (enum campaign_latch_cause)campaign_get_u8(&reader);
    by = campaign_get_short(&reader, &length);
    end = reader.at;
    if (campaign_get_u32(&reader) != campaign_crc32(0, memory, end) || reader.failed ||
        reader.at != memory_used || length > CAMPAIGN_LONGEST_HOST)
        return false;
    memcpy(latch->by, by, length);
    latch->by[length] = '\0';
    return true;
}

static bool on_remember(void *context, const struct campaign_latch *latch)
{
    (void)context;
    printf("remember %d %lu %d ", latch->latched, (unsigned long)latch->count, (int)latch->cause);
    print_octets((const campaign_octet *)latch->by, strlen(latch->by));
    putchar('\n');
    if (!memory_works) {
        puts("failed");
        return false;
    }
    write_memory(latch);
    return true;
}

static struct campaign_hooks hooks = {
    NULL,    on_send,      on_set,      on_clear,   on_arm,             on_channels,     on_start,
    on_stop, on_drive_off, is_drive_on, is_at_rest, does_fault_persist, get_temperature, on_remember,
};

static const char *const features[] = {"rate", "torque"};
static const char *const compensations[] = {"observer"};
static const struct campaign_limit limits[] = {{"limits.angle", 1.0}, {"limits.rate", 2.0}};
static struct campaign_identity identity = {
    7, "console", "reference", features, 2, compensations, 1, limits, 2,
    100000, 2000000, 1000, 1000.0,
};

static void switch_on(void)
{
    struct campaign_latch kept;
    const bool is_known = read_memory(&kept);
    drive = persists = false;
    rest = true;
    identity.boot++;
    campaign_device_init(&device, &hooks, &identity, ring, (uint32_t)records_kept,
                         is_known ? &kept : NULL);
}

static void renew(unsigned long records, const char *past, unsigned long count)
{
    static const struct campaign_latch never = {false, 0, CAMPAIGN_NOT_LATCHED, ""};
    const struct campaign_latch by_ada = {true, (uint32_t)count, CAMPAIGN_STOPPED, "ada"};
    const bool forgetful = past != NULL && strcmp(past, "forgetful") == 0;
    write_memory(past != NULL && strcmp(past, "latched") == 0 ? &by_ada : &never);
    if (forgetful)
        memory_used = 0;
    memory_works = true;
    hooks.remember = forgetful ? NULL : on_remember;
    records_kept = records == 0 || records > MOST_RECORDS ? MOST_RECORDS : records;
    identity.boot = 6;
    switch_on();
}

static void decode(size_t count)
{
    struct campaign_frame frame;
    for (size_t i = 0; i < count; i++)
        if (campaign_decoder_push(&decoder, octets[i], &frame)) {
            printf("frame %u %u ", frame.kind, frame.sequence);
            print_octets(frame.body, frame.length);
            putchar('\n');
        }
}

static unsigned long number(const char *text)
{
    return text == NULL ? 0 : strtoul(text, NULL, 10);
}

/* Frames and their parts; false when it is none of these commands. */
static bool codec(const char *word, const char *a, const char *b, const char *c)
{
    static campaign_octet out[CAMPAIGN_COBS_LENGTH(LONGEST_LINE)];
    size_t count;
    if (strcmp(word, "crc") == 0) {
        count = read_octets(a);
        printf("crc %08lx\n", (unsigned long)campaign_crc32(0, octets, count));
    } else if (strcmp(word, "cobs") == 0) {
        count = read_octets(a);
        print_line("cobs", out, campaign_cobs_encode(octets, count, out));
    } else if (strcmp(word, "uncobs") == 0) {
        count = read_octets(a);
        print_line("cobs", out, campaign_cobs_decode(octets, count, out));
    } else if (strcmp(word, "encode") == 0) {
        count = read_octets(c);
        print_line("frame", out,
                   campaign_frame_encode((unsigned)number(a), (unsigned)number(b), octets, count,
                                         out));
    } else if (strcmp(word, "decode") == 0) {
        decode(read_octets(a));
    } else if (strcmp(word, "forget") == 0) {
        campaign_decoder_init(&decoder);
    } else if (strcmp(word, "counts") == 0) {
        const struct campaign_counts *n = &decoder.counts;
        printf("counts %lu %lu %lu %lu %lu %lu\n", (unsigned long)n->good,
               (unsigned long)n->bad_cobs, (unsigned long)n->too_short,
               (unsigned long)n->too_long, (unsigned long)n->bad_crc,
               (unsigned long)n->wrong_version);
    } else {
        return false;
    }
    return true;
}

static void act(const char *word, const char *a, const char *b, const char *c)
{
    size_t count;
    if (strcmp(word, "new") == 0) {
        renew(number(a), b, number(c));
    } else if (strcmp(word, "reset") == 0) {
        switch_on();
    } else if (strcmp(word, "wipe") == 0) {
        memory_used = 0;
        switch_on();
    } else if (strcmp(word, "cut") == 0) {
        count = number(a);
        memory_used = count < memory_used ? count : memory_used;
        switch_on();
    } else if (strcmp(word, "fill") == 0) {
        count = number(a);
        memset(memory, (int)number(b), count < memory_used ? count : memory_used);
        switch_on();
    } else if (strcmp(word, "memory") == 0) {
        memory_works = number(a) != 0;
    } else if (strcmp(word, "receive") == 0) {
        count = read_octets(b);
        campaign_device_receive(&device, octets, count, number(a));
    } else if (strcmp(word, "tick") == 0) {
        campaign_device_tick(&device, number(a));
    } else if (strcmp(word, "samples") == 0) {
        count = read_octets(c);
        if (!campaign_device_samples(&device, (uint32_t)number(a), (uint32_t)number(b), octets,
                                     count))
            puts("refused");
    } else if (strcmp(word, "event") == 0) {
        if (!campaign_device_event(&device, a == NULL ? 0.0 : strtod(a, NULL), read_text(b)))
            puts("refused");
    } else if (strcmp(word, "finish") == 0) {
        campaign_device_finish(&device, (enum campaign_outcome)number(a),
                               (enum campaign_fault)number(b), read_text(c));
    } else if (strcmp(word, "rest") == 0) {
        rest = number(a) != 0;
    } else if (strcmp(word, "persists") == 0) {
        persists = number(a) != 0;
    } else {
        puts("unknown");
    }
}

/* As it comes from a sensor: infinite and undefined as well, which no message may be. */
static double measured_f64(struct campaign_reader *reader)
{
    const uint64_t bits = campaign_get_u64(reader);
    double value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

/* The watch over limits, which is no part of the device; false when it is neither command. */
static bool watch_limits(const char *word, const char *a)
{
    static double rates[MOST_RATES];
    static struct campaign_limit_watch watch;
    static unsigned long taken;
    if (strcmp(word, "limits") == 0) {
        struct campaign_reader reader = {octets, read_octets(a), 0, false};
        struct campaign_limits given;
        given.angle = measured_f64(&reader);
        given.rate = measured_f64(&reader);
        given.rate_time = measured_f64(&reader);
        given.torque = measured_f64(&reader);
        given.current = measured_f64(&reader);
        const double sample_rate = measured_f64(&reader);
        taken = 0;
        printf("samples %lu\n", (unsigned long)campaign_limits_init(&watch, &given, sample_rate,
                                                                    rates, MOST_RATES));
        return true;
    }
    if (strcmp(word, "measured") != 0)
        return false;
    const size_t count = read_octets(a) / 32u;
    struct campaign_reader reader = {octets, count * 32u, 0, false};
    for (size_t i = 0; i < count; i++, taken++) {
        struct campaign_measured measured;
        measured.angle = measured_f64(&reader);
        measured.rate = measured_f64(&reader);
        measured.torque = measured_f64(&reader);
        measured.current = measured_f64(&reader);
        const enum campaign_verdict verdict = campaign_limits_check(&watch, &measured);
        if (verdict != CAMPAIGN_WITHIN) {
            printf("ends %lu %d\n", taken, (int)verdict);
            break;
        }
    }
    return true;
}

int main(void)
{
    renew(MOST_RECORDS, NULL, 0);
    puts(".");
    fflush(stdout);
    campaign_decoder_init(&decoder);
    while (fgets(line, sizeof line, stdin) != NULL) {
        const char *word = strtok(line, " \n");
        const char *a = strtok(NULL, " \n");
        const char *b = strtok(NULL, " \n");
        const char *c = strtok(NULL, " \n");
        if (word != NULL && !codec(word, a, b, c) && !watch_limits(word, a))
            act(word, a, b, c);
        puts(".");
        fflush(stdout);
    }
    return 0;
}
