/* The latch: what somebody else than its host has stopped does not move before a person lets it. */
#include "campaign_internal.h"

#include <string.h>

static const char nobody[] = "an unnamed host";

void campaign_latch_init(struct campaign_device *device, const struct campaign_latch *latch)
{
    if (latch != NULL) {
        device->latch = *latch;
        device->latch.by[CAMPAIGN_LONGEST_HOST] = '\0';
    } else {
        device->latch.latched = true;
        device->latch.count = device->identity->boot; /* no count of an earlier life */
        device->latch.cause = CAMPAIGN_NO_MEMORY;
    }
}

static bool remember(struct campaign_device *device)
{
    const struct campaign_hooks *hooks = device->hooks;
    device->unremembered =
        hooks->remember != NULL && !hooks->remember(hooks->context, &device->latch);
    return !device->unremembered;
}

/* A session's SAFE, sent until it is confirmed, is one stop. What does not say whose it is counts
 * each time: it might be another one, which nobody has seen. */
static void set_latch(struct campaign_device *device, uint32_t session, const char *by)
{
    struct campaign_latch *latch = &device->latch;
    const bool again = latch->latched && session != 0 && session == device->stopped_by;
    if (again)
        return; /* where it is not remembered yet, the next tick tries again */
    device->stopped_by = session;
    device->stopped_at = device->now;
    device->stopped_at_known = true;
    latch->latched = true;
    latch->count = (latch->count + 1u) & 0xFFFFFFFFu;
    latch->cause = CAMPAIGN_STOPPED;
    strcpy(latch->by, by);
    (void)remember(device); /* where that fails it holds until the next reset, and is tried again */
}

void campaign_latch_tick(struct campaign_device *device)
{
    if (device->unremembered && !campaign_may_move(device))
        (void)remember(device);
}

void campaign_on_safe(struct campaign_device *device, const struct campaign_frame *frame)
{
    char by[CAMPAIGN_LONGEST_HOST + 1u], reason[CAMPAIGN_LONGEST_HOST + 16u] = "panic stop by ";
    uint32_t session;
    bool from_outside;
    device->hooks->drive_off(device->hooks->context); /* before anything else */
    session = campaign_get_safe(frame->body, frame->length, by, CAMPAIGN_LONGEST_HOST);
    if (by[0] == '\0')
        strcpy(by, nobody);
    from_outside = session == 0 || !campaign_is_of_session(device, session);
    strcat(reason, by);
    campaign_begin_ending(device, CAMPAIGN_INTERRUPTED, CAMPAIGN_NO_FAULT,
                          from_outside ? reason : "switched off by SAFE");
    if (device->state != CAMPAIGN_IN_FAULT)
        device->state = CAMPAIGN_IN_SAFE;
    if (from_outside)
        set_latch(device, session, by);
    campaign_send_ack(device, frame->sequence, frame->kind);
    campaign_device_status(device);
    if (from_outside)
        campaign_send_latch(device);
}

struct campaign_refusal campaign_latch_check(struct campaign_device *device)
{
    const char *by = device->latch.by;
    if (!device->latch.latched)
        return campaign_accepted();
    strcpy(device->stopped_text, "stopped by ");
    strcat(device->stopped_text, by[0] != '\0' ? by : "an unknown host");
    return campaign_refused(CAMPAIGN_LATCHED, device->stopped_text);
}

struct campaign_refusal campaign_do_unlatch(struct campaign_device *device, uint32_t count)
{
    const struct campaign_latch before = device->latch;
    const bool unremembered = device->unremembered;
    if (campaign_may_move(device))
        return campaign_refused(CAMPAIGN_WRONG_STATE, NULL);
    if (!before.latched || count != before.count)
        return campaign_refused(CAMPAIGN_OTHER_STOP, "that is not its latest stop");
    device->latch.latched = false;
    device->latch.cause = CAMPAIGN_NOT_LATCHED;
    if (!remember(device)) {
        device->latch = before;
        device->unremembered = unremembered;
        return campaign_refused(CAMPAIGN_NOT_READY, "it could not be remembered");
    }
    return campaign_accepted();
}
