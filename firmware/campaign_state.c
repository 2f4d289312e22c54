#include "campaign_internal.h"

#include <string.h>

static const struct campaign_refusal accepted = {CAMPAIGN_ACCEPTED, NULL};

static struct campaign_refusal refused(enum campaign_nak code, const char *text)
{
    const struct campaign_refusal refusal = {code, text};
    return refusal;
}

/* States */

static void enter(struct campaign_device *device, enum campaign_state state)
{
    const bool news = state != device->state;
    device->state = state;
    if (state != CAMPAIGN_IN_FAULT)
        device->fault = CAMPAIGN_NO_FAULT;
    if (news)
        campaign_device_status(device);
}

static bool watched(const struct campaign_device *device)
{
    return device->state == CAMPAIGN_ARMED || device->state == CAMPAIGN_RUNNING;
}

static void become_idle(struct campaign_device *device)
{
    device->configuration_crc = 0;
    device->trial = device->first_record = device->next_record = 0;
    device->samples = 0;
    device->hooks->clear(device->hooks->context);
    device->state = CAMPAIGN_IDLE;
    device->fault = CAMPAIGN_NO_FAULT;
}

/* Records */

static bool store(struct campaign_device *device, unsigned kind,
                  const struct campaign_writer *writer)
{
    struct campaign_record *record = &device->ring[device->next_record % device->ring_records];
    if (writer->failed || writer->used > CAMPAIGN_RECORD_BODY)
        return false;
    if (device->next_record - device->first_record == device->ring_records)
        device->first_record++; /* the oldest one is lost, and said so when it is asked for */
    record->kind = kind;
    record->length = writer->used;
    memcpy(record->body, writer->data, writer->used * sizeof *writer->data);
    device->next_record++;
    campaign_send(device, kind, record->body, record->length);
    return true;
}

static struct campaign_writer begin_record(struct campaign_device *device)
{
    struct campaign_writer writer = campaign_begin(device);
    campaign_put_u32(&writer, device->trial);
    campaign_put_u32(&writer, device->next_record);
    return writer;
}

bool campaign_device_samples(struct campaign_device *device, uint32_t first, uint32_t count,
                             const campaign_octet *data, size_t length)
{
    struct campaign_writer writer = begin_record(device);
    if (device->state != CAMPAIGN_RUNNING || device->ending || count == 0 || count > 0xFFFFu
        || length == 0 || length % count != 0)
        return false;
    campaign_put_u32(&writer, first);
    campaign_put_u16(&writer, count);
    campaign_put_octets(&writer, data, length);
    if (!store(device, CAMPAIGN_SAMPLES, &writer))
        return false;
    device->samples = first + count;
    return true;
}

bool campaign_device_event(struct campaign_device *device, double time, const char *text)
{
    struct campaign_writer writer = begin_record(device);
    if (device->state != CAMPAIGN_RUNNING || device->ending)
        return false;
    campaign_put_f64(&writer, time);
    campaign_put_long(&writer, text);
    return store(device, CAMPAIGN_EVENT, &writer);
}

static void store_end(struct campaign_device *device, bool safe)
{
    struct campaign_writer writer = begin_record(device);
    campaign_put_u8(&writer, device->outcome);
    campaign_put_u8(&writer, device->ending_fault);
    campaign_put_u32(&writer, device->samples);
    campaign_put_u8(&writer, safe);
    campaign_put_long(&writer, device->reason);
    (void)store(device, CAMPAIGN_END, &writer);
}

/* The first reason for an end is the one that END tells. */
static void begin_ending(struct campaign_device *device, enum campaign_outcome outcome,
                         enum campaign_fault fault, const char *reason)
{
    size_t length = reason == NULL ? 0 : strlen(reason);
    if (device->state != CAMPAIGN_RUNNING || device->ending)
        return;
    if (length > CAMPAIGN_LONGEST_TEXT)
        length = CAMPAIGN_LONGEST_TEXT;
    while (length > 0 && !campaign_is_utf8((const campaign_octet *)reason, length))
        length--; /* not through the middle of a character */
    if (length > 0)
        memcpy(device->reason, reason, length);
    device->reason[length] = '\0';
    device->ending = true;
    device->ending_at = device->now;
    device->outcome = outcome;
    device->ending_fault = fault;
}

static void fail(struct campaign_device *device, enum campaign_fault fault, const char *reason)
{
    device->hooks->drive_off(device->hooks->context);
    begin_ending(device, CAMPAIGN_FAILED, fault, reason);
    if (device->state == CAMPAIGN_IN_FAULT)
        return; /* the first fault is the one to tell */
    device->fault = fault;
    enter(device, CAMPAIGN_IN_FAULT);
}

void campaign_device_finish(struct campaign_device *device, enum campaign_outcome outcome,
                            enum campaign_fault fault, const char *reason)
{
    if (outcome == CAMPAIGN_FAILED) {
        fail(device, fault, reason);
    } else if (device->state == CAMPAIGN_RUNNING && !device->ending) {
        begin_ending(device, outcome, CAMPAIGN_NO_FAULT, reason);
        device->hooks->stop(device->hooks->context);
    }
    campaign_device_tick(device, device->now);
}

void campaign_device_tick(struct campaign_device *device, uint64_t now_us)
{
    const struct campaign_hooks *hooks = device->hooks;
    bool at_rest;
    device->now = now_us;
    if (watched(device)
        && now_us - device->heartbeat_at > device->identity->heartbeat_timeout_us)
        fail(device, CAMPAIGN_NO_HEARTBEATS, "no heartbeat was heard");
    if (!device->ending)
        return;
    at_rest = hooks->at_rest(hooks->context);
    if (!at_rest && now_us - device->ending_at < device->identity->rest_timeout_us)
        return;
    hooks->drive_off(hooks->context);
    store_end(device, at_rest && !hooks->drive_on(hooks->context));
    device->ending = false;
    if (device->state == CAMPAIGN_RUNNING)
        enter(device, CAMPAIGN_ENDED);
}

static bool items_are_whole(struct campaign_reader reader, struct campaign_item *item)
{
    const uint32_t count = campaign_get_u8(&reader);
    for (uint32_t i = 0; i < count && !reader.failed; i++)
        campaign_get_item(&reader, item);
    return count > 0 && !reader.failed && reader.at == reader.size;
}

static struct campaign_refusal set_items(struct campaign_device *device,
                                         struct campaign_reader reader,
                                         struct campaign_item *item, bool commit)
{
    const uint32_t count = campaign_get_u8(&reader);
    for (uint32_t i = 0; i < count; i++) {
        struct campaign_refusal refusal;
        campaign_get_item(&reader, item);
        refusal = device->hooks->set(device->hooks->context, item, commit);
        if (!commit && refusal.code != CAMPAIGN_ACCEPTED) {
            memcpy(device->last_name, item->name, sizeof item->name);
            return refusal;
        }
    }
    return accepted;
}

/* Commands: each carries itself out or says why not, in the latter case without any effect */

static struct campaign_refusal do_set(struct campaign_device *device,
                                      const struct campaign_frame *frame)
{
    const struct campaign_reader reader = {frame->body, frame->length, 0, false};
    struct campaign_item item;
    struct campaign_refusal refusal;
    if (!items_are_whole(reader, &item))
        return refused(CAMPAIGN_MALFORMED, NULL);
    if (device->state != CAMPAIGN_IDLE && device->state != CAMPAIGN_CONFIGURED)
        return refused(CAMPAIGN_WRONG_STATE, NULL);
    refusal = set_items(device, reader, &item, false);
    if (refusal.code != CAMPAIGN_ACCEPTED)
        return refusal;
    (void)set_items(device, reader, &item, true);
    device->configuration_crc =
        campaign_crc32(device->configuration_crc, frame->body, frame->length);
    device->state = CAMPAIGN_CONFIGURED;
    return accepted;
}

static bool heard_lately(const struct campaign_device *device)
{
    return device->heard
           && device->now - device->heartbeat_at <= device->identity->heartbeat_timeout_us;
}

static struct campaign_refusal do_arm(struct campaign_device *device, uint32_t crc)
{
    struct campaign_refusal refusal;
    if (device->state != CAMPAIGN_CONFIGURED)
        return refused(CAMPAIGN_WRONG_STATE, NULL);
    if (crc != device->configuration_crc)
        return refused(CAMPAIGN_CHECKSUM, NULL);
    if (!heard_lately(device))
        return refused(CAMPAIGN_NO_HEARTBEAT, NULL);
    refusal = device->hooks->arm(device->hooks->context);
    if (refusal.code == CAMPAIGN_ACCEPTED)
        device->state = CAMPAIGN_ARMED;
    return refusal;
}

static struct campaign_refusal do_start(struct campaign_device *device, uint32_t trial)
{
    if (trial == 0)
        return refused(CAMPAIGN_MALFORMED, NULL);
    if (device->state != CAMPAIGN_ARMED)
        return refused(CAMPAIGN_WRONG_STATE, NULL);
    if (!heard_lately(device))
        return refused(CAMPAIGN_NO_HEARTBEAT, NULL);
    device->trial = trial;
    device->first_record = device->next_record = device->samples = 0;
    device->state = CAMPAIGN_RUNNING;
    device->hooks->start(device->hooks->context);
    return accepted;
}

static struct campaign_refusal do_stop(struct campaign_device *device)
{
    if (device->state == CAMPAIGN_RUNNING) {
        if (!device->ending) {
            begin_ending(device, CAMPAIGN_INTERRUPTED, CAMPAIGN_NO_FAULT, "stopped by the host");
            device->hooks->stop(device->hooks->context);
        }
        return accepted;
    }
    if (device->state == CAMPAIGN_ENDED || device->state == CAMPAIGN_IN_SAFE
        || device->state == CAMPAIGN_IN_FAULT)
        return accepted;
    return refused(CAMPAIGN_WRONG_STATE, NULL);
}

static struct campaign_refusal do_release(struct campaign_device *device, uint32_t trial)
{
    if (device->state != CAMPAIGN_ENDED)
        return refused(CAMPAIGN_WRONG_STATE, NULL);
    if (trial != device->trial)
        return refused(CAMPAIGN_WRONG_TRIAL, NULL);
    become_idle(device);
    return accepted;
}

static struct campaign_refusal do_clear(struct campaign_device *device)
{
    if (device->state == CAMPAIGN_RUNNING || device->state == CAMPAIGN_ENDED)
        return refused(CAMPAIGN_WRONG_STATE, NULL);
    if (device->ending)
        return refused(CAMPAIGN_NOT_READY, "the axis is not at rest");
    if (device->state == CAMPAIGN_IN_FAULT
        && device->hooks->fault_persists(device->hooks->context))
        return refused(CAMPAIGN_CAUSE_PERSISTS, NULL);
    become_idle(device);
    return accepted;
}

static struct campaign_refusal carry_out(struct campaign_device *device,
                                         const struct campaign_frame *frame)
{
    struct campaign_reader reader = {frame->body, frame->length, 0, false};
    uint32_t value = 0;
    switch (frame->kind) {
    case CAMPAIGN_SET:
        return do_set(device, frame);
    case CAMPAIGN_ARM:
    case CAMPAIGN_START:
    case CAMPAIGN_RELEASE:
        value = campaign_get_u32(&reader);
        break;
    case CAMPAIGN_STOP:
    case CAMPAIGN_CLEAR:
        break;
    default:
        return refused(CAMPAIGN_UNKNOWN_MESSAGE, NULL);
    }
    if (reader.failed || reader.at != reader.size)
        return refused(CAMPAIGN_MALFORMED, NULL);
    switch (frame->kind) {
    case CAMPAIGN_ARM:
        return do_arm(device, value);
    case CAMPAIGN_START:
        return do_start(device, value);
    case CAMPAIGN_RELEASE:
        return do_release(device, value);
    case CAMPAIGN_STOP:
        return do_stop(device);
    default:
        return do_clear(device);
    }
}

static void on_hello(struct campaign_device *device, const struct campaign_frame *frame)
{
    struct campaign_reader reader = {frame->body, frame->length, 0, false};
    const uint32_t lowest = campaign_get_u8(&reader);
    const uint32_t highest = campaign_get_u8(&reader);
    const uint32_t session = campaign_get_u32(&reader);
    const size_t length = campaign_get_u8(&reader);
    const campaign_octet *host = campaign_get_octets(&reader, length);
    const bool renewed = device->in_session && device->session == session;
    if (host == NULL || reader.at != reader.size || !campaign_is_utf8(host, length)) {
        campaign_send_nak(device, frame->sequence, frame->kind, CAMPAIGN_MALFORMED, NULL, NULL);
        return;
    }
    if (lowest > CAMPAIGN_VERSION || highest < CAMPAIGN_VERSION) {
        campaign_send_capabilities(device, frame->sequence, 0);
        return;
    }
    if (!renewed && watched(device)) {
        campaign_send_nak(device, frame->sequence, frame->kind, CAMPAIGN_BUSY, NULL,
                 "another session is using this device");
        return;
    }
    if (!renewed && device->state == CAMPAIGN_CONFIGURED)
        become_idle(device);
    if (!renewed || device->hello_sequence != frame->sequence) {
        device->last_sequence = frame->sequence;
        device->answered = false;
    }
    device->in_session = true;
    device->session = session;
    device->hello_sequence = frame->sequence;
    campaign_send_capabilities(device, frame->sequence, CAMPAIGN_VERSION);
}

static void on_safe(struct campaign_device *device, const struct campaign_frame *frame)
{
    enum campaign_state before = device->state;
    device->hooks->drive_off(device->hooks->context);
    begin_ending(device, CAMPAIGN_INTERRUPTED, CAMPAIGN_NO_FAULT, "switched off by SAFE");
    if (before != CAMPAIGN_IN_FAULT)
        device->state = CAMPAIGN_IN_SAFE;
    campaign_send_ack(device, frame->sequence, frame->kind);
    campaign_device_status(device);
}

static void on_heartbeat(struct campaign_device *device, const struct campaign_frame *frame)
{
    struct campaign_reader reader = {frame->body, frame->length, 0, false};
    const uint32_t counter = campaign_get_u32(&reader);
    const uint32_t trial = campaign_get_u32(&reader);
    const uint32_t next = campaign_get_u32(&reader);
    if (reader.failed || reader.at != reader.size)
        return;
    device->heard = true;
    device->heartbeat = counter;
    device->heartbeat_at = device->now;
    /* Never beyond what exists: a mistaken host must not free records to come. */
    if (trial == device->trial && next > device->first_record && next <= device->next_record)
        device->first_record = next;
    campaign_device_status(device);
}

static void on_resend(struct campaign_device *device, const struct campaign_frame *frame)
{
    struct campaign_reader reader = {frame->body, frame->length, 0, false};
    const uint32_t trial = campaign_get_u32(&reader);
    uint32_t first = campaign_get_u32(&reader);
    const uint32_t count = campaign_get_u32(&reader);
    uint32_t lost = 0, last;
    if (reader.failed || reader.at != reader.size || count == 0
        || count - 1u > 0xFFFFFFFFu - first)
        return;
    last = first + (count - 1u);
    if (trial == 0 || trial != device->trial)
        lost = count;
    else if (first < device->first_record)
        lost = (last < device->first_record ? last + 1u : device->first_record) - first;
    if (lost > 0) {
        struct campaign_writer writer = campaign_begin(device);
        campaign_put_u32(&writer, trial);
        campaign_put_u32(&writer, first);
        campaign_put_u32(&writer, lost);
        campaign_send_body(device, CAMPAIGN_LOST, &writer);
        if (lost == count)
            return;
        first += lost;
    }
    for (uint32_t sent = 0; first <= last && first < device->next_record
                            && sent < CAMPAIGN_RESEND_MOST; first++, sent++) {
        const struct campaign_record *record = &device->ring[first % device->ring_records];
        campaign_send(device, record->kind, record->body, record->length);
    }
}

static void answer(struct campaign_device *device, const struct campaign_frame *frame)
{
    if (device->last_answer != CAMPAIGN_ACCEPTED) {
        campaign_send_nak(device, frame->sequence, frame->kind, device->last_answer, device->last_name,
                 device->last_text);
        return;
    }
    campaign_send_ack(device, frame->sequence, frame->kind);
    if (frame->kind == CAMPAIGN_ARM)
        campaign_send_channels(device, frame->sequence);
}

static void on_command(struct campaign_device *device, const struct campaign_frame *frame)
{
    const campaign_octet kind = (campaign_octet)frame->kind;
    const uint32_t crc =
        campaign_crc32(campaign_crc32(0, &kind, 1), frame->body, frame->length);
    enum campaign_state before = device->state;
    if (device->in_session && device->answered && device->last_sequence == frame->sequence
        && device->last_crc == crc) {
        answer(device, frame); /* a repetition: carried out already */
        return;
    }
    if (!device->in_session || frame->sequence != ((device->last_sequence + 1u) & 0xFFFFu)) {
        campaign_send_nak(device, frame->sequence, frame->kind, CAMPAIGN_OUT_OF_ORDER, NULL, NULL);
        return;
    }
    {
        struct campaign_refusal refusal;
        device->last_name[0] = '\0';
        refusal = carry_out(device, frame);
        device->last_sequence = frame->sequence;
        device->last_crc = crc;
        device->answered = true;
        device->last_answer = refusal.code;
        device->last_text = refusal.text;
    }
    answer(device, frame);
    if (device->state != before)
        campaign_device_status(device);
}

static void dispatch(struct campaign_device *device, const struct campaign_frame *frame)
{
    if (frame->kind & 0x80u)
        return; /* another device's, or our own echo */
    switch (frame->kind) {
    case CAMPAIGN_HELLO:
        on_hello(device, frame);
        break;
    case CAMPAIGN_SAFE:
        on_safe(device, frame);
        break;
    case CAMPAIGN_HEARTBEAT:
        on_heartbeat(device, frame);
        break;
    case CAMPAIGN_RESEND:
        on_resend(device, frame);
        break;
    default:
        on_command(device, frame);
    }
}

void campaign_device_init(struct campaign_device *device, const struct campaign_hooks *hooks,
                          const struct campaign_identity *identity, struct campaign_record *ring,
                          uint32_t ring_records)
{
    memset(device, 0, sizeof *device);
    device->hooks = hooks;
    device->identity = identity;
    device->ring = ring;
    device->ring_records = ring_records;
    campaign_decoder_init(&device->decoder);
    hooks->drive_off(hooks->context);
}

void campaign_device_receive(struct campaign_device *device, const campaign_octet *data,
                             size_t count, uint64_t now_us)
{
    struct campaign_frame frame;
    device->now = now_us;
    for (size_t i = 0; i < count; i++)
        if (campaign_decoder_push(&device->decoder, data[i], &frame))
            dispatch(device, &frame);
    campaign_device_tick(device, now_us);
}
