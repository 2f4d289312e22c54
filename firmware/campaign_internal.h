/* Shared by the parts of the device; not for the application. */
#ifndef CAMPAIGN_INTERNAL_H
#define CAMPAIGN_INTERNAL_H

#include "campaign_state.h"

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

#endif
