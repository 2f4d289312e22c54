/* The device's end of the serial protocol: state machine, numbered commands, ring of records.
 *
 * The application supplies hooks and calls campaign_device_receive() with what the port received,
 * campaign_device_tick() at least every millisecond, and campaign_device_samples() as it samples.
 * Everything runs in one context; nothing blocks but the application's own `send`.
 */
#ifndef CAMPAIGN_STATE_H
#define CAMPAIGN_STATE_H

#include "campaign_wire.h"

#define CAMPAIGN_LONGEST_NAME 64u
#define CAMPAIGN_LONGEST_TEXT 512u
#define CAMPAIGN_LONGEST_SLICE 64u
/* Octets that are kept of who a host says it is. */
#define CAMPAIGN_LONGEST_HOST 120u
/* Records sent at once for one RESEND; the host asks again for the rest. */
#define CAMPAIGN_RESEND_MOST 32u

/* Octets a record in the ring may have; a device with few channels saves memory with less. */
#ifndef CAMPAIGN_RECORD_BODY
#define CAMPAIGN_RECORD_BODY CAMPAIGN_MAX_BODY
#endif
#if CAMPAIGN_RECORD_BODY < 544
#error "the ring must be able to keep an END with the longest reason"
#endif

enum campaign_state {
    CAMPAIGN_IDLE,
    CAMPAIGN_CONFIGURED,
    CAMPAIGN_ARMED,
    CAMPAIGN_RUNNING,
    CAMPAIGN_ENDED,
    CAMPAIGN_IN_SAFE,
    CAMPAIGN_IN_FAULT
};

enum campaign_nak {
    CAMPAIGN_ACCEPTED = 0, /* not on the wire */
    CAMPAIGN_WRONG_STATE = 1,
    CAMPAIGN_UNKNOWN_MESSAGE = 2,
    CAMPAIGN_MALFORMED = 3,
    CAMPAIGN_UNKNOWN_NAME = 4,
    CAMPAIGN_WRONG_TYPE = 5,
    CAMPAIGN_OUT_OF_RANGE = 6,
    CAMPAIGN_TOO_LARGE = 7,
    CAMPAIGN_CHECKSUM = 8,
    CAMPAIGN_INCOMPLETE = 9,
    CAMPAIGN_LIMIT = 10,
    CAMPAIGN_NOT_READY = 11,
    CAMPAIGN_OUT_OF_ORDER = 12,
    CAMPAIGN_BUSY = 13,
    CAMPAIGN_NO_VERSION = 14,
    CAMPAIGN_WRONG_TRIAL = 15,
    CAMPAIGN_CAUSE_PERSISTS = 16,
    CAMPAIGN_NO_HEARTBEAT = 17,
    CAMPAIGN_LATCHED = 18,
    CAMPAIGN_OTHER_STOP = 19
};

enum campaign_outcome {
    CAMPAIGN_COMPLETED,
    CAMPAIGN_BEYOND_LIMIT,
    CAMPAIGN_DIVERGED,
    CAMPAIGN_FAILED,
    CAMPAIGN_INTERRUPTED
};

enum campaign_fault {
    CAMPAIGN_NO_FAULT = 0,
    CAMPAIGN_LOST_CONNECTION = 1,
    CAMPAIGN_LOST_SAMPLES = 2,
    CAMPAIGN_NO_HEARTBEATS = 3,
    CAMPAIGN_RESET = 4,
    CAMPAIGN_OVER_TEMPERATURE = 5,
    CAMPAIGN_LIMIT_SWITCH = 6,
    CAMPAIGN_SENSOR = 7,
    CAMPAIGN_DRIVE = 8,
    CAMPAIGN_REFUSED = 9,
    CAMPAIGN_OTHER = 255
};

enum campaign_latch_cause {
    CAMPAIGN_NOT_LATCHED,
    CAMPAIGN_STOPPED,  /* by a SAFE that was not of the device's session */
    CAMPAIGN_NO_MEMORY /* it has started, and cannot know whether it was stopped */
};

enum campaign_tag {
    CAMPAIGN_F64 = 1,
    CAMPAIGN_I64 = 2,
    CAMPAIGN_BOOL = 3,
    CAMPAIGN_TEXT = 4,
    CAMPAIGN_F64_ARRAY = 5
};

enum campaign_format {
    CAMPAIGN_FORMAT_F64 = 1,
    CAMPAIGN_FORMAT_F32 = 2,
    CAMPAIGN_FORMAT_I32 = 3,
    CAMPAIGN_FORMAT_I16 = 4
};

/* One parameter of a SET, or one slice of an array. Pointers are valid during the hook only. */
struct campaign_item {
    char name[CAMPAIGN_LONGEST_NAME + 1u];
    enum campaign_tag tag;
    double f64;
    uint64_t i64; /* two's complement */
    bool truth;
    const campaign_octet *text; /* UTF-8, not terminated */
    size_t text_length;
    uint32_t total, offset, count;         /* of the array, and of this slice in it */
    double values[CAMPAIGN_LONGEST_SLICE]; /* `count` of them */
};

struct campaign_channel {
    const char *name, *unit, *display_unit, *label;
    bool measured;
    enum campaign_format format;
    double scale;
};

struct campaign_limit {
    const char *name; /* "limits.angle" */
    double value;     /* SI */
};

/* Why a hook refuses; static strings of at most 255 octets, or NULL. */
struct campaign_refusal {
    enum campaign_nak code; /* CAMPAIGN_ACCEPTED: it does not */
    const char *text;
};

/* What has to outlive a reset: whether the device was stopped from outside. */
struct campaign_latch {
    bool latched;
    uint32_t count; /* of stops so far; whoever clears one names it */
    enum campaign_latch_cause cause;
    char by[CAMPAIGN_LONGEST_HOST + 1u]; /* who sent the latest; UTF-8 */
};

struct campaign_hooks {
    void *context; /* handed to every hook */
    void (*send)(void *context, const campaign_octet *data, size_t count);
    /* Every item of a SET is first tried with `commit` false, then, when none was refused, set. */
    struct campaign_refusal (*set)(void *context, const struct campaign_item *item, bool commit);
    /* Forget the configuration. */
    void (*clear)(void *context);
    /* Check completeness, limits, rest; from here on `channels` and `sample_rate` are fixed. */
    struct campaign_refusal (*arm)(void *context);
    const struct campaign_channel *(*channels)(void *context, size_t *count, double *sample_rate);
    /* Drive on, and the trial begins. */
    void (*start)(void *context);
    /* Brake; the trial is to end. */
    void (*stop)(void *context);
    /* Drive off, now. Called again and again where it matters; must be quick and harmless. */
    void (*drive_off)(void *context);
    bool (*drive_on)(void *context);
    bool (*at_rest)(void *context);
    /* The cause of the last fault is still there. */
    bool (*fault_persists)(void *context);
    /* Degrees Celsius; NaN without a sensor. */
    double (*temperature)(void *context);
    /* Keep this where a reset does not reach it; true when it is there, not when it will be. Called
     * with the drive off and before the stop, or its end, is acknowledged. NULL: there is no such
     * memory. */
    bool (*remember)(void *context, const struct campaign_latch *latch);
};

struct campaign_identity {
    uint32_t boot; /* differs at every start */
    const char *name, *firmware;
    const char *const *features;
    size_t feature_count;
    const char *const *compensations;
    size_t compensation_count;
    const struct campaign_limit *limits;
    size_t limit_count;
    uint32_t heartbeat_timeout_us;
    uint32_t rest_timeout_us; /* what braking may take; then END says: not safe */
    uint32_t longest_array;
    double highest_sample_rate;
};

struct campaign_record {
    unsigned kind;
    size_t length;
    campaign_octet body[CAMPAIGN_RECORD_BODY];
};

struct campaign_device {
    const struct campaign_hooks *hooks;
    const struct campaign_identity *identity;
    struct campaign_record *ring;
    uint32_t ring_records;
    struct campaign_decoder decoder;

    enum campaign_state state;
    enum campaign_fault fault;
    uint64_t now; /* microseconds since start */
    unsigned frames_sent;

    bool in_session;
    uint32_t session;
    char host[CAMPAIGN_LONGEST_HOST + 1u]; /* whose it is */
    unsigned hello_sequence;
    unsigned last_sequence;
    bool answered; /* the last command is one that may be repeated */
    uint32_t last_crc;
    enum campaign_nak last_answer;
    char last_name[CAMPAIGN_LONGEST_NAME + 1u];
    const char *last_text;
    char stopped_text[CAMPAIGN_LONGEST_HOST + 16u];

    struct campaign_latch latch;
    bool unremembered;     /* the memory failed at the latest stop */
    uint32_t stopped_by;   /* session of the latest stop, 0 for nobody's */
    bool stopped_at_known; /* it was since the start */
    uint64_t stopped_at;

    bool heard; /* HELLO counts once, then heartbeats of the session do */
    uint32_t heartbeat;
    uint64_t heartbeat_at;

    uint32_t configuration_crc;
    uint32_t trial, first_record, next_record;
    uint32_t samples;
    bool ending; /* END is made when the axis is at rest */
    enum campaign_outcome outcome;
    enum campaign_fault ending_fault;
    char reason[CAMPAIGN_LONGEST_TEXT + 1u];
    uint64_t ending_at;

    campaign_octet frame[CAMPAIGN_MAX_FRAME];
    campaign_octet body[CAMPAIGN_MAX_BODY];
};

/* `latch`: what `remember` was last given, before the reset; all zero in a device that was never
 * stopped. NULL when that cannot be known: the device then starts latched. */
void campaign_device_init(struct campaign_device *device, const struct campaign_hooks *hooks,
                          const struct campaign_identity *identity, struct campaign_record *ring,
                          uint32_t ring_records, const struct campaign_latch *latch);
void campaign_device_receive(struct campaign_device *device, const campaign_octet *data,
                             size_t count, uint64_t now_us);
/* Watch the heartbeats, finish a trial that is ending. */
void campaign_device_tick(struct campaign_device *device, uint64_t now_us);

/* Records of the running trial; false when none is running, it is ending already, or they do not
 * fit into a record. Samples are packed little-endian, channel after channel. */
bool campaign_device_samples(struct campaign_device *device, uint32_t first, uint32_t count,
                             const campaign_octet *data, size_t length);
bool campaign_device_event(struct campaign_device *device, double time, const char *text);
/* The trial is over: the axis is brought to rest, then END is sent. A fault switches the drive off
 * at once, and is a fault without a trial as well. */
void campaign_device_finish(struct campaign_device *device, enum campaign_outcome outcome,
                            enum campaign_fault fault, const char *reason);
void campaign_device_status(struct campaign_device *device);

/* The next item of a SET body; `failed` of the reader when there is none or it is malformed. */
void campaign_get_item(struct campaign_reader *reader, struct campaign_item *item);

#endif
