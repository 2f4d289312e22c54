/* Shared by the parts of the device; not for the application. */
#ifndef CAMPAIGN_INTERNAL_H
#define CAMPAIGN_INTERNAL_H

#include "campaign_state.h"

/* campaign_sending.c: what the device says */

/* A body under construction in the device's own memory: one at a time. */
struct campaign_writer campaign_begin(struct campaign_device *device);
void campaign_send(struct campaign_device *device, unsigned kind, const campaign_octet *body,
                   size_t length);
void campaign_send_body(struct campaign_device *device, unsigned kind,
                        const struct campaign_writer *writer);
void campaign_send_ack(struct campaign_device *device, unsigned sequence, unsigned kind);
void campaign_send_nak(struct campaign_device *device, unsigned sequence, unsigned kind,
                       enum campaign_nak code, const char *name, const char *text);
void campaign_send_capabilities(struct campaign_device *device, unsigned sequence,
                                unsigned version);
void campaign_send_channels(struct campaign_device *device, unsigned sequence);
void campaign_send_latch(struct campaign_device *device);
void campaign_send_holder(struct campaign_device *device);

/* campaign_state.c: states and the end of a trial */

bool campaign_may_move(const struct campaign_device *device); /* armed or running */
void campaign_become_idle(struct campaign_device *device);
void campaign_begin_ending(struct campaign_device *device, enum campaign_outcome outcome,
                           enum campaign_fault fault, const char *reason);

/* campaign_records.c: the ring */

void campaign_store_end(struct campaign_device *device, bool safe);
void campaign_on_resend(struct campaign_device *device, const struct campaign_frame *frame);

/* campaign_session.c: who holds the device */

bool campaign_heard_lately(const struct campaign_device *device);
bool campaign_is_of_session(const struct campaign_device *device, uint32_t session);
void campaign_on_hello(struct campaign_device *device, const struct campaign_frame *frame);
void campaign_on_heartbeat(struct campaign_device *device, const struct campaign_frame *frame);
void campaign_on_query(struct campaign_device *device, const struct campaign_frame *frame);
void campaign_on_bye(struct campaign_device *device, const struct campaign_frame *frame);

/* campaign_latch.c: panic stops */

void campaign_latch_init(struct campaign_device *device, const struct campaign_latch *latch);
void campaign_on_safe(struct campaign_device *device, const struct campaign_frame *frame);
/* Try again what could not be remembered. */
void campaign_latch_tick(struct campaign_device *device);
/* Why nothing may arm or start, if so. */
struct campaign_refusal campaign_latch_check(struct campaign_device *device);
struct campaign_refusal campaign_do_unlatch(struct campaign_device *device, uint32_t count);

/* campaign_commands.c: what is numbered */

struct campaign_refusal campaign_accepted(void);
struct campaign_refusal campaign_refused(enum campaign_nak code, const char *text);
void campaign_on_command(struct campaign_device *device, const struct campaign_frame *frame);

#endif
