/* Numbered commands: carried out once and in order, however often they come. */
#include "campaign_internal.h"

#include <string.h>

struct campaign_refusal campaign_accepted(void)
{
    return campaign_refused(CAMPAIGN_ACCEPTED, NULL);
}

struct campaign_refusal campaign_refused(enum campaign_nak code, const char *text)
{
    const struct campaign_refusal refusal = {code, text};
    return refusal;
}

/* Each carries itself out or says why not, in the latter case without any effect. */

static bool items_are_whole(struct campaign_reader reader, struct campaign_item *item)
{
    const uint32_t count = campaign_get_u8(&reader);
    for (uint32_t i = 0; i < count && !reader.failed; i++)
        campaign_get_item(&reader, item);
    return count > 0 && campaign_is_whole(&reader);
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
    return campaign_accepted();
}

static struct campaign_refusal do_set(struct campaign_device *device,
                                      const struct campaign_frame *frame)
{
    const struct campaign_reader reader = {frame->body, frame->length, 0, false};
    struct campaign_item item;
    struct campaign_refusal refusal;
    if (!items_are_whole(reader, &item))
        return campaign_refused(CAMPAIGN_MALFORMED, NULL);
    if (device->state != CAMPAIGN_IDLE && device->state != CAMPAIGN_CONFIGURED)
        return campaign_refused(CAMPAIGN_WRONG_STATE, NULL);
    refusal = set_items(device, reader, &item, false);
    if (refusal.code != CAMPAIGN_ACCEPTED)
        return refusal;
    (void)set_items(device, reader, &item, true);
    device->configuration_crc =
        campaign_crc32(device->configuration_crc, frame->body, frame->length);
    device->state = CAMPAIGN_CONFIGURED;
    return campaign_accepted();
}

static struct campaign_refusal may_arm_or_start(struct campaign_device *device)
{
    const struct campaign_refusal refusal = campaign_latch_check(device);
    if (refusal.code == CAMPAIGN_ACCEPTED && !campaign_heard_lately(device))
        return campaign_refused(CAMPAIGN_NO_HEARTBEAT, NULL);
    return refusal;
}

static struct campaign_refusal do_arm(struct campaign_device *device, uint32_t crc)
{
    struct campaign_refusal refusal;
    if (device->state != CAMPAIGN_CONFIGURED)
        return campaign_refused(CAMPAIGN_WRONG_STATE, NULL);
    refusal = may_arm_or_start(device);
    if (refusal.code != CAMPAIGN_ACCEPTED)
        return refusal;
    if (crc != device->configuration_crc)
        return campaign_refused(CAMPAIGN_CHECKSUM, NULL);
    refusal = device->hooks->arm(device->hooks->context);
    if (refusal.code == CAMPAIGN_ACCEPTED)
        device->state = CAMPAIGN_ARMED;
    return refusal;
}

static struct campaign_refusal do_start(struct campaign_device *device, uint32_t trial)
{
    struct campaign_refusal refusal;
    if (trial == 0)
        return campaign_refused(CAMPAIGN_MALFORMED, NULL);
    if (device->state != CAMPAIGN_ARMED)
        return campaign_refused(CAMPAIGN_WRONG_STATE, NULL);
    refusal = may_arm_or_start(device);
    if (refusal.code != CAMPAIGN_ACCEPTED)
        return refusal;
    device->trial = trial;
    device->first_record = device->next_record = device->samples = 0;
    device->state = CAMPAIGN_RUNNING;
    device->hooks->start(device->hooks->context);
    return campaign_accepted();
}

static struct campaign_refusal do_stop(struct campaign_device *device)
{
    if (device->state == CAMPAIGN_RUNNING) {
        if (!device->ending) {
            campaign_begin_ending(device, CAMPAIGN_INTERRUPTED, CAMPAIGN_NO_FAULT,
                                  "stopped by the host");
            device->hooks->stop(device->hooks->context);
        }
        return campaign_accepted();
    }
    if (device->state == CAMPAIGN_ENDED || device->state == CAMPAIGN_IN_SAFE
        || device->state == CAMPAIGN_IN_FAULT)
        return campaign_accepted();
    return campaign_refused(CAMPAIGN_WRONG_STATE, NULL);
}

static struct campaign_refusal do_release(struct campaign_device *device, uint32_t trial)
{
    if (device->state != CAMPAIGN_ENDED)
        return campaign_refused(CAMPAIGN_WRONG_STATE, NULL);
    if (trial != device->trial)
        return campaign_refused(CAMPAIGN_WRONG_TRIAL, NULL);
    campaign_become_idle(device);
    return campaign_accepted();
}

static struct campaign_refusal do_clear(struct campaign_device *device)
{
    if (device->state == CAMPAIGN_RUNNING || device->state == CAMPAIGN_ENDED)
        return campaign_refused(CAMPAIGN_WRONG_STATE, NULL);
    if (device->ending)
        return campaign_refused(CAMPAIGN_NOT_READY, "the axis is not at rest");
    if (device->state == CAMPAIGN_IN_FAULT
        && device->hooks->fault_persists(device->hooks->context))
        return campaign_refused(CAMPAIGN_CAUSE_PERSISTS, NULL);
    campaign_become_idle(device);
    return campaign_accepted();
}

static struct campaign_refusal carry_out(struct campaign_device *device,
                                         const struct campaign_frame *frame)
{
    struct campaign_reader reader = {frame->body, frame->length, 0, false};
    uint32_t value = 0;
    size_t length;
    switch (frame->kind) {
    case CAMPAIGN_SET:
        return do_set(device, frame);
    case CAMPAIGN_ARM:
    case CAMPAIGN_START:
    case CAMPAIGN_RELEASE:
        value = campaign_get_u32(&reader);
        break;
    case CAMPAIGN_UNLATCH:
        value = campaign_get_u32(&reader);
        (void)campaign_get_short(&reader, &length);
        break;
    case CAMPAIGN_STOP:
    case CAMPAIGN_CLEAR:
        break;
    default:
        return campaign_refused(CAMPAIGN_UNKNOWN_MESSAGE, NULL);
    }
    if (!campaign_is_whole(&reader))
        return campaign_refused(CAMPAIGN_MALFORMED, NULL);
    switch (frame->kind) {
    case CAMPAIGN_ARM:
        return do_arm(device, value);
    case CAMPAIGN_START:
        return do_start(device, value);
    case CAMPAIGN_RELEASE:
        return do_release(device, value);
    case CAMPAIGN_STOP:
        return do_stop(device);
    case CAMPAIGN_UNLATCH:
        return campaign_do_unlatch(device, value);
    default:
        return do_clear(device);
    }
}

static void answer(struct campaign_device *device, const struct campaign_frame *frame)
{
    if (device->last_answer != CAMPAIGN_ACCEPTED) {
        campaign_send_nak(device, frame->sequence, frame->kind, device->last_answer,
                          device->last_name, device->last_text);
        return;
    }
    campaign_send_ack(device, frame->sequence, frame->kind);
    if (frame->kind == CAMPAIGN_ARM)
        campaign_send_channels(device, frame->sequence);
    if (frame->kind == CAMPAIGN_UNLATCH)
        campaign_send_latch(device); /* as it is now: there may have been a stop since */
}

void campaign_on_command(struct campaign_device *device, const struct campaign_frame *frame)
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
