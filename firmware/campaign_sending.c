/* What a device says: one function per message. */
#include "campaign_internal.h"

#include <math.h>

struct campaign_writer campaign_begin(struct campaign_device *device)
{
    const struct campaign_writer writer = {device->body, CAMPAIGN_MAX_BODY, 0, false};
    return writer;
}

void campaign_send(struct campaign_device *device, unsigned kind, const campaign_octet *body,
                 size_t length)
{
    const size_t used =
        campaign_frame_encode(kind, device->frames_sent, body, length, device->frame);
    device->frames_sent = (device->frames_sent + 1u) & 0xFFFFu;
    device->hooks->send(device->hooks->context, device->frame, used);
}

void campaign_send_body(struct campaign_device *device, unsigned kind,
                      const struct campaign_writer *writer)
{
    if (!writer->failed)
        campaign_send(device, kind, writer->data, writer->used);
}

void campaign_send_ack(struct campaign_device *device, unsigned sequence, unsigned kind)
{
    struct campaign_writer writer = campaign_begin(device);
    campaign_put_u16(&writer, sequence);
    campaign_put_u8(&writer, kind);
    campaign_put_u8(&writer, device->state);
    campaign_put_u32(&writer, device->identity->boot);
    campaign_send_body(device, CAMPAIGN_ACK, &writer);
}

void campaign_send_nak(struct campaign_device *device, unsigned sequence, unsigned kind,
                     enum campaign_nak code, const char *name, const char *text)
{
    struct campaign_writer writer = campaign_begin(device);
    campaign_put_u16(&writer, sequence);
    campaign_put_u8(&writer, kind);
    campaign_put_u8(&writer, code);
    campaign_put_u8(&writer, device->state);
    campaign_put_short(&writer, name);
    campaign_put_short(&writer, text);
    campaign_send_body(device, CAMPAIGN_NAK, &writer);
}

static void put_words(struct campaign_writer *writer, const char *const *words, size_t count)
{
    campaign_put_u8(writer, (uint32_t)count);
    for (size_t i = 0; i < count; i++)
        campaign_put_short(writer, words[i]);
}

void campaign_send_capabilities(struct campaign_device *device, unsigned sequence, unsigned version)
{
    const struct campaign_identity *identity = device->identity;
    struct campaign_writer writer = campaign_begin(device);
    campaign_put_u16(&writer, sequence);
    campaign_put_u8(&writer, version);
    campaign_put_u8(&writer, CAMPAIGN_VERSION);
    campaign_put_u8(&writer, CAMPAIGN_VERSION);
    campaign_put_u32(&writer, identity->boot);
    campaign_put_u8(&writer, device->state);
    campaign_put_f64(&writer, identity->heartbeat_timeout_us / 1e6);
    campaign_put_u32(&writer, device->ring_records);
    campaign_put_u32(&writer, identity->longest_array);
    campaign_put_f64(&writer, identity->highest_sample_rate);
    campaign_put_short(&writer, identity->name);
    campaign_put_short(&writer, identity->firmware);
    put_words(&writer, identity->features, identity->feature_count);
    put_words(&writer, identity->compensations, identity->compensation_count);
    campaign_put_u8(&writer, (uint32_t)identity->limit_count);
    for (size_t i = 0; i < identity->limit_count; i++) {
        campaign_put_short(&writer, identity->limits[i].name);
        campaign_put_u8(&writer, CAMPAIGN_F64);
        campaign_put_f64(&writer, identity->limits[i].value);
    }
    campaign_send_body(device, CAMPAIGN_CAPABILITIES, &writer);
}

static void put_channel(struct campaign_writer *writer, const struct campaign_channel *channel)
{
    campaign_put_short(writer, channel->name);
    campaign_put_short(writer, channel->unit);
    campaign_put_short(writer, channel->display_unit);
    campaign_put_short(writer, channel->label);
    campaign_put_u8(writer, channel->measured);
    campaign_put_u8(writer, channel->format);
    campaign_put_f64(writer, channel->scale);
}

/* As many frames as it takes; each as full as channels come. */
void campaign_send_channels(struct campaign_device *device, unsigned sequence)
{
    size_t count, first = 0;
    double rate;
    const struct campaign_channel *channels =
        device->hooks->channels(device->hooks->context, &count, &rate);
    while (first < count) {
        struct campaign_writer writer = campaign_begin(device);
        size_t next = first;
        campaign_put_u16(&writer, sequence);
        campaign_put_u8(&writer, (uint32_t)count);
        campaign_put_u8(&writer, (uint32_t)first);
        campaign_put_f64(&writer, rate);
        campaign_put_u8(&writer, 0);
        while (next < count) {
            struct campaign_writer trial = writer;
            put_channel(&trial, &channels[next]);
            if (trial.failed)
                break;
            writer = trial;
            next++;
        }
        if (next == first)
            return; /* a channel that fits into no frame is the application's mistake */
        writer.data[12] = (campaign_octet)(next - first);
        campaign_send_body(device, CAMPAIGN_CHANNELS, &writer);
        first = next;
    }
}

void campaign_device_status(struct campaign_device *device)
{
    const struct campaign_hooks *hooks = device->hooks;
    struct campaign_writer writer = campaign_begin(device);
    campaign_put_u8(&writer, device->state);
    campaign_put_u8(&writer, device->fault);
    campaign_put_u8(&writer, hooks->at_rest(hooks->context));
    campaign_put_u8(&writer, hooks->drive_on(hooks->context));
    campaign_put_u32(&writer, device->identity->boot);
    campaign_put_f64(&writer, (double)device->now / 1e6);
    campaign_put_u32(&writer, device->heartbeat);
    campaign_put_f64(&writer, (double)(device->now - device->heartbeat_at) / 1e6);
    campaign_put_u32(&writer, device->trial);
    campaign_put_u32(&writer, device->first_record);
    campaign_put_u32(&writer, device->next_record);
    campaign_put_u32(&writer, device->next_record - device->first_record);
    campaign_put_u32(&writer, campaign_bad_frames(&device->decoder.counts));
    campaign_put_f64(&writer, hooks->temperature(hooks->context));
    campaign_send_body(device, CAMPAIGN_STATUS, &writer);
}

static double seconds_since(const struct campaign_device *device, bool known, uint64_t then)
{
    return known ? (double)(device->now - then) / 1e6 : (double)NAN;
}

void campaign_send_latch(struct campaign_device *device)
{
    const struct campaign_latch *latch = &device->latch;
    struct campaign_writer writer = campaign_begin(device);
    campaign_put_u8(&writer, latch->latched);
    campaign_put_u32(&writer, latch->count);
    campaign_put_u8(&writer, latch->cause);
    campaign_put_f64(&writer, seconds_since(device, device->stopped_at_known, device->stopped_at));
    campaign_put_short(&writer, latch->by);
    campaign_send_body(device, CAMPAIGN_LATCH, &writer);
}

void campaign_send_holder(struct campaign_device *device)
{
    struct campaign_writer writer = campaign_begin(device);
    campaign_put_u8(&writer, campaign_heard_lately(device));
    campaign_put_f64(&writer, seconds_since(device, device->heard, device->heartbeat_at));
    campaign_put_short(&writer, device->host);
    campaign_send_body(device, CAMPAIGN_HOLDER, &writer);
}
