/* Framing of the serial protocol (docs/developers/serial-protocol.md): COBS, CRC-32, frames.
 *
 * Portable C99: no allocation, no operating system, no alignment or byte order assumed. An octet is
 * the low 8 bits of a char-sized cell, so a DSP whose char has 16 bits stores one octet per cell.
 */
#ifndef CAMPAIGN_WIRE_H
#define CAMPAIGN_WIRE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef uint_least8_t campaign_octet;

/* Of frames, for ever; and of the protocol, as HELLO negotiates it. */
#define CAMPAIGN_FRAME_VERSION 1u
#define CAMPAIGN_VERSION 2u
#define CAMPAIGN_MAX_BODY 1024u
#define CAMPAIGN_HEADER 4u
#define CAMPAIGN_OVERHEAD (CAMPAIGN_HEADER + 4u)
/* Most octets that n octets may become by COBS. */
#define CAMPAIGN_COBS_LENGTH(n) ((n) + ((n) == 0u ? 1u : ((n) + 253u) / 254u))
/* Between two delimiters, and with both. */
#define CAMPAIGN_MAX_ENCODED CAMPAIGN_COBS_LENGTH(CAMPAIGN_MAX_BODY + CAMPAIGN_OVERHEAD)
#define CAMPAIGN_MAX_FRAME (CAMPAIGN_MAX_ENCODED + 2u)

enum campaign_kind {
    CAMPAIGN_HELLO = 0x01,
    CAMPAIGN_SET = 0x02,
    CAMPAIGN_ARM = 0x03,
    CAMPAIGN_START = 0x04,
    CAMPAIGN_HEARTBEAT = 0x05,
    CAMPAIGN_RESEND = 0x06,
    CAMPAIGN_RELEASE = 0x07,
    CAMPAIGN_STOP = 0x08,
    CAMPAIGN_SAFE = 0x09,
    CAMPAIGN_CLEAR = 0x0A,
    CAMPAIGN_QUERY = 0x0B,
    CAMPAIGN_UNLATCH = 0x0C,
    CAMPAIGN_BYE = 0x0D,
    CAMPAIGN_CAPABILITIES = 0x81,
    CAMPAIGN_ACK = 0x82,
    CAMPAIGN_NAK = 0x83,
    CAMPAIGN_CHANNELS = 0x84,
    CAMPAIGN_STATUS = 0x85,
    CAMPAIGN_SAMPLES = 0x86,
    CAMPAIGN_EVENT = 0x87,
    CAMPAIGN_END = 0x88,
    CAMPAIGN_LOST = 0x89,
    CAMPAIGN_LATCH = 0x8A,
    CAMPAIGN_HOLDER = 0x8B
};

/* Continue a CRC-32 (begin with 0) over `count` octets. */
uint32_t campaign_crc32(uint32_t crc, const campaign_octet *data, size_t count);

/* Both return the number of octets written. `out` of the encoder holds CAMPAIGN_COBS_LENGTH(count)
 * octets; `out` of the decoder may be `data` itself. The decoder returns 0 for what no encoder
 * makes, and for an encoding of nothing. */
size_t campaign_cobs_encode(const campaign_octet *data, size_t count, campaign_octet *out);
size_t campaign_cobs_decode(const campaign_octet *data, size_t count, campaign_octet *out);

/* A body under construction; `failed` once something did not fit. */
struct campaign_writer {
    campaign_octet *data;
    size_t size;
    size_t used;
    bool failed;
};

void campaign_put_u8(struct campaign_writer *writer, uint32_t value);
void campaign_put_u16(struct campaign_writer *writer, uint32_t value);
void campaign_put_u32(struct campaign_writer *writer, uint32_t value);
void campaign_put_f64(struct campaign_writer *writer, double value);
void campaign_put_octets(struct campaign_writer *writer, const campaign_octet *data, size_t count);
/* Text after its length, u8 or u16; NULL is the empty text. */
void campaign_put_short(struct campaign_writer *writer, const char *text);
void campaign_put_long(struct campaign_writer *writer, const char *text);

/* A body being read; `failed` once something was not there. Reads after that give 0. */
struct campaign_reader {
    const campaign_octet *data;
    size_t size;
    size_t at;
    bool failed;
};

uint32_t campaign_get_u8(struct campaign_reader *reader);
uint32_t campaign_get_u16(struct campaign_reader *reader);
uint32_t campaign_get_u32(struct campaign_reader *reader);
uint64_t campaign_get_u64(struct campaign_reader *reader);
/* Fails as well when the number is not finite. */
double campaign_get_f64(struct campaign_reader *reader);
const campaign_octet *campaign_get_octets(struct campaign_reader *reader, size_t count);
/* A text after its length u8. Fails as well, and is NULL, when it is not UTF-8. */
const campaign_octet *campaign_get_short(struct campaign_reader *reader, size_t *length);
/* The session that a body of SAFE is of, and the host, as by campaign_keep_text(). Every body is one:
 * 0 and no host for what is no session, or anything else. */
uint32_t campaign_get_safe(const campaign_octet *body, size_t length, char *host, size_t most);
/* Whether all went well and nothing is left. */
bool campaign_is_whole(const struct campaign_reader *reader);
/* Whether `count` octets are well-formed UTF-8. */
bool campaign_is_utf8(const campaign_octet *data, size_t count);
/* Keep a text, terminated, of `out`, which holds `most` + 1; not cut through a character. A zero in
 * it ends it. */
void campaign_keep_text(char *out, size_t most, const campaign_octet *text, size_t length);

struct campaign_frame {
    unsigned kind;
    unsigned sequence;
    const campaign_octet *body; /* valid until the decoder is fed again */
    size_t length;
};

/* The octets to send, delimiters included; `out` holds CAMPAIGN_MAX_FRAME. 0: the body is too
 * long. */
size_t campaign_frame_encode(unsigned kind, unsigned sequence, const campaign_octet *body,
                             size_t length, campaign_octet *out);

struct campaign_counts {
    uint32_t good, bad_cobs, too_short, too_long, bad_crc, wrong_version;
};

struct campaign_decoder {
    campaign_octet buffer[CAMPAIGN_MAX_ENCODED];
    size_t used;
    bool overlong;
    struct campaign_counts counts;
};

void campaign_decoder_init(struct campaign_decoder *decoder);
/* Give one received octet; true when it completed a good frame. */
bool campaign_decoder_push(struct campaign_decoder *decoder, campaign_octet octet,
                           struct campaign_frame *frame);
uint32_t campaign_bad_frames(const struct campaign_counts *counts);

#endif
