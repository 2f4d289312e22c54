/* Who holds the device, and whether it is heard. */
#include "campaign_internal.h"

#include <string.h>

static const char nameless[] = "a host that did not say its name";

bool campaign_heard_lately(const struct campaign_device *device)
{
    return device->heard
           && device->now - device->heartbeat_at <= device->identity->heartbeat_timeout_us;
}

bool campaign_is_of_session(const struct campaign_device *device, uint32_t session)
{
    return device->in_session && session == device->session;
}

static void send_busy(struct campaign_device *device, const struct campaign_frame *frame)
{
    char text[sizeof nameless + CAMPAIGN_LONGEST_HOST + 16u] = "it is held by ";
    strcat(text, device->host[0] != '\0' ? device->host : nameless);
    campaign_send_nak(device, frame->sequence, frame->kind, CAMPAIGN_BUSY, NULL, text);
}

static void begin_session(struct campaign_device *device, uint32_t session, unsigned sequence)
{
    const bool renewed = campaign_is_of_session(device, session);
    if (!renewed) {
        if (device->state == CAMPAIGN_CONFIGURED)
            campaign_become_idle(device);
        device->heard = true; /* heartbeats take a moment to follow */
        device->heartbeat = 0;
        device->heartbeat_at = device->now;
    }
    if (!renewed || device->hello_sequence != sequence) {
        device->last_sequence = sequence;
        device->answered = false;
    }
    device->in_session = true;
    device->session = session;
    device->hello_sequence = sequence;
}

void campaign_on_hello(struct campaign_device *device, const struct campaign_frame *frame)
{
    struct campaign_reader reader = {frame->body, frame->length, 0, false};
    const enum campaign_state before = device->state;
    const uint32_t lowest = campaign_get_u8(&reader);
    const uint32_t highest = campaign_get_u8(&reader);
    const uint32_t session = campaign_get_u32(&reader);
    size_t length;
    const campaign_octet *host = campaign_get_short(&reader, &length);
    if (!campaign_is_whole(&reader) || session == 0) {
        campaign_send_nak(device, frame->sequence, frame->kind, CAMPAIGN_MALFORMED, NULL, NULL);
        return;
    }
    if (lowest > CAMPAIGN_VERSION || highest < CAMPAIGN_VERSION) {
        campaign_send_capabilities(device, frame->sequence, 0);
        return;
    }
    if (!campaign_is_of_session(device, session)
        && (campaign_may_move(device) || campaign_heard_lately(device))) {
        send_busy(device, frame);
        return;
    }
    begin_session(device, session, frame->sequence);
    campaign_keep_text(device->host, CAMPAIGN_LONGEST_HOST, host, length);
    campaign_send_capabilities(device, frame->sequence, CAMPAIGN_VERSION);
    campaign_send_latch(device);
    if (device->state != before)
        campaign_device_status(device);
}

void campaign_on_heartbeat(struct campaign_device *device, const struct campaign_frame *frame)
{
    struct campaign_reader reader = {frame->body, frame->length, 0, false};
    const uint32_t counter = campaign_get_u32(&reader);
    const uint32_t trial = campaign_get_u32(&reader);
    const uint32_t next = campaign_get_u32(&reader);
    const uint32_t session = campaign_get_u32(&reader);
    if (!campaign_is_whole(&reader))
        return;
    if (campaign_is_of_session(device, session)) {
        device->heard = true;
        device->heartbeat = counter;
        device->heartbeat_at = device->now;
        /* Never beyond what exists: a mistaken host must not free records to come. */
        if (trial == device->trial && next > device->first_record && next <= device->next_record)
            device->first_record = next;
    }
    campaign_device_status(device); /* whosever it is */
}

void campaign_on_query(struct campaign_device *device, const struct campaign_frame *frame)
{
    if (frame->length > 0)
        return;
    campaign_device_status(device);
    campaign_send_latch(device);
    campaign_send_holder(device);
}

void campaign_on_bye(struct campaign_device *device, const struct campaign_frame *frame)
{
    struct campaign_reader reader = {frame->body, frame->length, 0, false};
    const uint32_t session = campaign_get_u32(&reader);
    if (campaign_is_whole(&reader) && campaign_is_of_session(device, session))
        device->heard = false;
}
