/* The device under arbitrary input: octets, frames, time, resets, samples, all in any order.
 *
 * libFuzzer: clang -g -fsanitize=fuzzer,address,undefined fuzz.c campaign_*.c -o fuzz; ./fuzz CORPUS
 * Without it: cc -DCAMPAIGN_FUZZ_MAIN -fsanitize=address,undefined ...; ./fuzz SEED COUNT FILE...
 * runs every file and then COUNT inputs made from them by chance.
 *
 * An input is a sequence of steps, each a first octet (modulo STEPS) and its operands; what is
 * missing at the end is zero. It ends in abort() when the device does what it never may:
 *   - send anything but one good frame at a time;
 *   - switch the drive on while it is latched, or in a state other than running;
 *   - leave the drive on without a trial, or after the heartbeats and the time for braking ended.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "campaign_limits.h"
#include "campaign_state.h"

#define RECORDS 16u
#define RATES 64u
#define HEARTBEAT_US 100000u
#define REST_US 2000000u

enum step {
    RAW,      /* u16 length, octets: what the port received */
    FRAME,    /* u8 kind, u8 sequence, u16 length, body: a good frame */
    TIME,     /* u16 in 100 us, then a tick */
    SAMPLES,  /* u8 skipped, u8 count, u8 octets of one */
    EVENT,    /* u8 length, text */
    FINISH,   /* u8 outcome, u8 fault, u8 length, text */
    WORLD,    /* u8 bits: at rest, cause persists, memory works */
    RESET,    /* u8: even with what it remembers, odd with its memory gone */
    WATCH,    /* u8 bits of the limits, u16 rate; measured samples of four u16 */
    STEPS
};

struct input {
    const uint8_t *data;
    size_t size, at;
};

static struct campaign_device device;
static struct campaign_record ring[RECORDS];
static struct campaign_latch kept;
static bool is_known, memory_works, drive, rest, persists;
static uint64_t now;

static void require(bool condition, const char *what)
{
    if (!condition) {
        fprintf(stderr, "fuzz: %s\n", what);
        abort();
    }
}

static unsigned take(struct input *input)
{
    return input->at < input->size ? input->data[input->at++] : 0u;
}

static unsigned take16(struct input *input)
{
    const unsigned low = take(input);
    return low | take(input) << 8;
}

/* In memory of its own length, so that a read past its end is seen. */
static campaign_octet *take_octets(struct input *input, size_t count)
{
    campaign_octet *octets = malloc(count ? count : 1u);
    require(octets != NULL, "no memory");
    for (size_t i = 0; i < count; i++)
        octets[i] = (campaign_octet)take(input);
    return octets;
}

static char *take_text(struct input *input, size_t length)
{
    char *text = malloc(length + 1u);
    require(text != NULL, "no memory");
    for (size_t i = 0; i < length; i++)
        text[i] = (char)take(input);
    text[length] = '\0';
    return text;
}

/* Hooks */

static void on_send(void *context, const campaign_octet *data, size_t count)
{
    static struct campaign_decoder decoder;
    struct campaign_frame frame;
    (void)context;
    require(count <= CAMPAIGN_MAX_FRAME, "a frame is too long");
    campaign_decoder_init(&decoder);
    for (size_t i = 0; i < count; i++)
        require(campaign_decoder_push(&decoder, data[i], &frame) == (i + 1u == count),
                "not one frame");
    require(campaign_bad_frames(&decoder.counts) == 0, "a bad frame");
    require(frame.kind >= CAMPAIGN_CAPABILITIES, "a host's message");
}

static struct campaign_refusal on_set(void *context, const struct campaign_item *item, bool commit)
{
    struct campaign_refusal refusal = {CAMPAIGN_ACCEPTED, NULL};
    double sum = 0.0;
    size_t letters = 0;
    (void)context;
    require(strlen(item->name) <= CAMPAIGN_LONGEST_NAME, "a name is too long");
    require(item->count <= CAMPAIGN_LONGEST_SLICE, "a slice is too long");
    if (item->tag == CAMPAIGN_F64_ARRAY)
        for (uint32_t i = 0; i < item->count; i++)
            sum += item->values[i];
    if (item->tag == CAMPAIGN_TEXT)
        for (size_t i = 0; i < item->text_length; i++)
            letters += item->text[i] != 0;
    if (item->name[0] == 'u' || (commit && sum != sum) || letters > 4096u) {
        refusal.code = CAMPAIGN_UNKNOWN_NAME;
        refusal.text = "no such parameter";
    }
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
    require(!device.latch.latched, "armed while latched");
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
    require(!device.latch.latched, "started while latched");
    require(device.heard && now - device.heartbeat_at <= HEARTBEAT_US, "started unheard");
    drive = true;
}

static void on_stop(void *context)
{
    (void)context;
}

static void on_drive_off(void *context)
{
    (void)context;
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

static bool on_remember(void *context, const struct campaign_latch *latch)
{
    (void)context;
    require(!drive, "remembers before the drive is off");
    if (memory_works) {
        kept = *latch;
        is_known = true;
    }
    return memory_works;
}

static const struct campaign_hooks hooks = {
    NULL,    on_send,      on_set,      on_clear,   on_arm,             on_channels,     on_start,
    on_stop, on_drive_off, is_drive_on, is_at_rest, does_fault_persist, get_temperature, on_remember,
};

static const char *const features[] = {"rate"};
static const struct campaign_limit limits[] = {{"limits.angle", 1.0}};
static struct campaign_identity identity = {
    6, "fuzz", "reference", features, 1, NULL, 0, limits, 1, HEARTBEAT_US, REST_US, 1000, 1000.0,
};

static void switch_on(void)
{
    drive = persists = false;
    rest = true;
    now = 0;
    identity.boot++;
    campaign_device_init(&device, &hooks, &identity, ring, RECORDS, is_known ? &kept : NULL);
    require(is_known || device.latch.latched, "it forgot and is not latched");
    require(!is_known || device.latch.latched == kept.latched, "a reset changed the latch");
}

/* Steps */

static void receive(const campaign_octet *data, size_t count)
{
    campaign_device_receive(&device, data, count, now);
}

static void step_frame(struct input *input)
{
    static campaign_octet frame[CAMPAIGN_MAX_FRAME];
    const unsigned kind = take(input), sequence = take(input);
    const size_t length = take16(input) % (CAMPAIGN_MAX_BODY + 1u);
    campaign_octet *body = take_octets(input, length);
    receive(frame, campaign_frame_encode(kind, sequence, body, length, frame));
    free(body);
}

static void step_samples(struct input *input)
{
    const uint32_t skipped = take(input) % 4u, count = take(input), each = take(input);
    const size_t length = (size_t)count * each;
    campaign_octet *data = take_octets(input, length < 4096u ? length : 4096u);
    campaign_device_samples(&device, device.samples + skipped, count, data,
                            length < 4096u ? length : 4096u);
    free(data);
}

static void step_finish(struct input *input)
{
    const unsigned outcome = take(input) % 5u, fault = take(input) % 10u;
    char *text = take_text(input, take(input) * 4u);
    campaign_device_finish(&device, (enum campaign_outcome)outcome, (enum campaign_fault)fault,
                           text);
    free(text);
}

static void step_watch(struct input *input)
{
    static double rates[RATES];
    static struct campaign_limit_watch watch;
    const unsigned bits = take(input);
    struct campaign_limits given;
    given.angle = bits & 1u ? 0.5 : 1e300;
    given.rate = bits & 2u ? 0.5 : 1e300;
    given.rate_time = bits & 4u ? 0.01 : 0.0;
    given.torque = bits & 8u ? 0.5 : 1e300;
    given.current = bits & 16u ? 0.5 : 1e300;
    if (!campaign_limits_init(&watch, &given, (double)take16(input), rates, RATES))
        return;
    for (unsigned count = take(input) % 64u; count > 0; count--) {
        struct campaign_measured measured;
        measured.angle = take16(input) / 32768.0 - 1.0;
        measured.rate = take16(input) / 32768.0 - 1.0;
        measured.torque = take16(input) / 32768.0 - 1.0;
        measured.current = bits & 32u ? 0.0 / (double)(count % 2u) : take16(input) / 32768.0;
        if (campaign_limits_check(&watch, &measured) != CAMPAIGN_WITHIN)
            break;
    }
}

static void step(struct input *input)
{
    size_t count;
    campaign_octet *octets;
    char *text;
    switch ((enum step)(take(input) % STEPS)) {
    case RAW:
        count = take16(input) % 4096u;
        octets = take_octets(input, count);
        receive(octets, count);
        free(octets);
        break;
    case FRAME:
        step_frame(input);
        break;
    case TIME:
        now += take16(input) * 100u;
        campaign_device_tick(&device, now);
        require(!drive || device.ending || now - device.heartbeat_at <= HEARTBEAT_US,
                "the drive is on without heartbeats");
        require(!drive || !device.ending || now - device.ending_at <= REST_US,
                "the drive is on after the time for braking");
        break;
    case SAMPLES:
        step_samples(input);
        break;
    case EVENT:
        text = take_text(input, take(input) * 4u);
        campaign_device_event(&device, (double)now / 1e6, text);
        free(text);
        break;
    case FINISH:
        step_finish(input);
        break;
    case WORLD:
        count = take(input);
        rest = count & 1u;
        persists = count & 2u;
        memory_works = !(count & 4u);
        break;
    case RESET:
        is_known = is_known && take(input) % 2u == 0;
        switch_on();
        break;
    case WATCH:
        step_watch(input);
        break;
    case STEPS:
        break;
    }
    require(!drive || device.state == CAMPAIGN_RUNNING, "the drive is on and no trial runs");
    require(!drive || !device.latch.latched, "the drive is on while latched");
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static const struct campaign_latch never = {false, 0, CAMPAIGN_NOT_LATCHED, ""};
    struct input input = {data, size, 0};
    kept = never;
    is_known = memory_works = true;
    identity.boot = 6;
    switch_on();
    while (input.at < input.size)
        step(&input);
    return 0;
}

#ifdef CAMPAIGN_FUZZ_MAIN

#define LONGEST_INPUT 8192u
#define MOST_FILES 512

static uint8_t inputs[MOST_FILES][LONGEST_INPUT];
static size_t sizes[MOST_FILES];
static uint32_t state;

/* xorshift32: the same numbers everywhere. */
static uint32_t chance(uint32_t below)
{
    state ^= state << 13;
    state ^= state >> 17;
    state ^= state << 5;
    return state % below;
}

static size_t mutate(uint8_t *data, size_t size, int files)
{
    for (uint32_t changes = chance(8u) + 1u; changes > 0; changes--) {
        const size_t at = size ? chance((uint32_t)size) : 0u;
        const int other = (int)chance((uint32_t)files);
        const size_t from = sizes[other] ? chance((uint32_t)sizes[other]) : 0u;
        size_t count = chance(64u);
        switch (chance(6u)) {
        case 0:
            if (size)
                data[at] ^= (uint8_t)(1u << chance(8u));
            break;
        case 1:
            if (size)
                data[at] = (uint8_t)chance(256u);
            break;
        case 2: /* a piece of another input, or of this one, put in */
        case 3:
            count = chance(4u) ? sizes[other] - from : count;
            count = count < sizes[other] - from ? count : sizes[other] - from;
            count = count < LONGEST_INPUT - size ? count : LONGEST_INPUT - size;
            memmove(data + at + count, data + at, size - at);
            memcpy(data + at, inputs[other] + from, count);
            size += count;
            break;
        case 4:
            count = count < size - at ? count : size - at;
            memmove(data + at, data + at + count, size - at - count);
            size -= count;
            break;
        default:
            if (size < LONGEST_INPUT)
                data[size++] = (uint8_t)chance(256u);
        }
    }
    return size;
}

int main(int argc, char **argv)
{
    static uint8_t made[LONGEST_INPUT];
    const int files = argc - 3 < MOST_FILES ? argc - 3 : MOST_FILES;
    if (files < 1) {
        fputs("fuzz SEED COUNT FILE...\n", stderr);
        return 2;
    }
    state = (uint32_t)strtoul(argv[1], NULL, 10) * 2654435761u + 1u;
    for (int i = 0; i < files; i++) {
        FILE *file = fopen(argv[3 + i], "rb");
        require(file != NULL, "a file cannot be read");
        sizes[i] = fread(inputs[i], 1u, LONGEST_INPUT, file);
        fclose(file);
        LLVMFuzzerTestOneInput(inputs[i], sizes[i]);
    }
    for (unsigned long left = strtoul(argv[2], NULL, 10); left > 0; left--) {
        const int from = (int)chance((uint32_t)files);
        memcpy(made, inputs[from], sizes[from]);
        LLVMFuzzerTestOneInput(made, mutate(made, sizes[from], files));
    }
    return 0;
}

#endif
