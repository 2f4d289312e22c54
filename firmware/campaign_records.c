/* The records of a trial: made, kept in a ring, sent, and sent again. */
#include "campaign_internal.h"

#include <string.h>

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

void campaign_store_end(struct campaign_device *device, bool safe)
{
    struct campaign_writer writer = begin_record(device);
    campaign_put_u8(&writer, device->outcome);
    campaign_put_u8(&writer, device->ending_fault);
    campaign_put_u32(&writer, device->samples);
    campaign_put_u8(&writer, safe);
    campaign_put_long(&writer, device->reason);
    (void)store(device, CAMPAIGN_END, &writer);
}

void campaign_on_resend(struct campaign_device *device, const struct campaign_frame *frame)
{
    struct campaign_reader reader = {frame->body, frame->length, 0, false};
    const uint32_t trial = campaign_get_u32(&reader);
    uint32_t first = campaign_get_u32(&reader);
    const uint32_t count = campaign_get_u32(&reader);
    uint32_t lost = 0, last;
    if (!campaign_is_whole(&reader) || count == 0
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
