/* The device: its states, the end of a trial, and which part of it a frame is for. */
#include "campaign_internal.h"

#include <string.h>

static void enter(struct campaign_device *device, enum campaign_state state)
{
    const bool news = state != device->state;
    device->state = state;
    if (state != CAMPAIGN_IN_FAULT)
        device->fault = CAMPAIGN_NO_FAULT;
    if (news)
        campaign_device_status(device);
}

bool campaign_may_move(const struct campaign_device *device)
{
    return device->state == CAMPAIGN_ARMED || device->state == CAMPAIGN_RUNNING;
}

void campaign_become_idle(struct campaign_device *device)
{
    device->configuration_crc = 0;
    device->trial = device->first_record = device->next_record = 0;
    device->samples = 0;
    device->hooks->clear(device->hooks->context);
    device->state = CAMPAIGN_IDLE;
    device->fault = CAMPAIGN_NO_FAULT;
}

/* The first reason for an end is the one that END tells. */
void campaign_begin_ending(struct campaign_device *device, enum campaign_outcome outcome,
                           enum campaign_fault fault, const char *reason)
{
    if (device->state != CAMPAIGN_RUNNING || device->ending)
        return;
    campaign_keep_text(device->reason, CAMPAIGN_LONGEST_TEXT, (const campaign_octet *)reason,
                       reason == NULL ? 0 : strlen(reason));
    device->ending = true;
    device->ending_at = device->now;
    device->outcome = outcome;
    device->ending_fault = fault;
}

static void fail(struct campaign_device *device, enum campaign_fault fault, const char *reason)
{
    device->hooks->drive_off(device->hooks->context);
    campaign_begin_ending(device, CAMPAIGN_FAILED, fault, reason);
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
        campaign_begin_ending(device, outcome, CAMPAIGN_NO_FAULT, reason);
        device->hooks->stop(device->hooks->context);
    }
    campaign_device_tick(device, device->now);
}

void campaign_device_tick(struct campaign_device *device, uint64_t now_us)
{
    const struct campaign_hooks *hooks = device->hooks;
    bool at_rest;
    device->now = now_us;
    campaign_latch_tick(device);
    if (campaign_may_move(device) && !campaign_heard_lately(device))
        fail(device, CAMPAIGN_NO_HEARTBEATS, "no heartbeat was heard");
    if (!device->ending)
        return;
    at_rest = hooks->at_rest(hooks->context);
    if (!at_rest && now_us - device->ending_at < device->identity->rest_timeout_us)
        return;
    hooks->drive_off(hooks->context);
    campaign_store_end(device, at_rest && !hooks->drive_on(hooks->context));
    device->ending = false;
    if (device->state == CAMPAIGN_RUNNING)
        enter(device, CAMPAIGN_ENDED);
}

static void dispatch(struct campaign_device *device, const struct campaign_frame *frame)
{
    if (frame->kind & 0x80u)
        return; /* another device's, or our own echo */
    switch (frame->kind) {
    case CAMPAIGN_HELLO:
        campaign_on_hello(device, frame);
        break;
    case CAMPAIGN_SAFE:
        campaign_on_safe(device, frame);
        break;
    case CAMPAIGN_HEARTBEAT:
        campaign_on_heartbeat(device, frame);
        break;
    case CAMPAIGN_RESEND:
        campaign_on_resend(device, frame);
        break;
    case CAMPAIGN_QUERY:
        campaign_on_query(device, frame);
        break;
    case CAMPAIGN_BYE:
        campaign_on_bye(device, frame);
        break;
    default:
        campaign_on_command(device, frame);
    }
}

void campaign_device_init(struct campaign_device *device, const struct campaign_hooks *hooks,
                          const struct campaign_identity *identity, struct campaign_record *ring,
                          uint32_t ring_records, const struct campaign_latch *latch)
{
    hooks->drive_off(hooks->context);
    memset(device, 0, sizeof *device);
    device->hooks = hooks;
    device->identity = identity;
    device->ring = ring;
    device->ring_records = ring_records;
    campaign_decoder_init(&device->decoder);
    campaign_latch_init(device, latch);
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
