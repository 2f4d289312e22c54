#include "campaign_wire.h"

#include <string.h>

#define LONGEST_BLOCK 0xFFu

/* Nibble by nibble: 16 words of table, and still some 10 MB/s on a small DSP. */
uint32_t campaign_crc32(uint32_t crc, const campaign_octet *data, size_t count)
{
    static const uint32_t table[16] = {
        0x00000000u, 0x1DB71064u, 0x3B6E20C8u, 0x26D930ACu, 0x76DC4190u, 0x6B6B51F4u,
        0x4DB26158u, 0x5005713Cu, 0xEDB88320u, 0xF00F9344u, 0xD6D6A3E8u, 0xCB61B38Cu,
        0x9B64C2B0u, 0x86D3D2D4u, 0xA00AE278u, 0xBDBDF21Cu,
    };
    crc = ~crc & 0xFFFFFFFFu;
    for (size_t i = 0; i < count; i++) {
        crc ^= data[i] & 0xFFu;
        crc = (crc >> 4) ^ table[crc & 0xFu];
        crc = (crc >> 4) ^ table[crc & 0xFu];
    }
    return ~crc & 0xFFFFFFFFu;
}

size_t campaign_cobs_encode(const campaign_octet *data, size_t count, campaign_octet *out)
{
    size_t code_at = 0, used = 1;
    unsigned code = 1;
    for (size_t i = 0; i < count; i++) {
        if (code == LONGEST_BLOCK) { /* full, and there is more: a new block */
            out[code_at] = (campaign_octet)code;
            code_at = used++;
            code = 1;
        }
        if ((data[i] & 0xFFu) == 0u) {
            out[code_at] = (campaign_octet)code;
            code_at = used++;
            code = 1;
        } else {
            out[used++] = (campaign_octet)(data[i] & 0xFFu);
            code++;
        }
    }
    out[code_at] = (campaign_octet)code;
    return used;
}

size_t campaign_cobs_decode(const campaign_octet *data, size_t count, campaign_octet *out)
{
    size_t at = 0, used = 0;
    while (at < count) {
        const unsigned code = data[at] & 0xFFu;
        if (code == 0u || code > count - at)
            return 0;
        for (size_t i = 1; i < code; i++) {
            if ((data[at + i] & 0xFFu) == 0u)
                return 0;
            out[used++] = data[at + i];
        }
        at += code;
        if (code != LONGEST_BLOCK && at < count)
            out[used++] = 0;
    }
    return used;
}

static bool fits(struct campaign_writer *writer, size_t count)
{
    if (writer->failed || count > writer->size - writer->used)
        writer->failed = true;
    return !writer->failed;
}

static void put(struct campaign_writer *writer, uint64_t value, unsigned count)
{
    if (fits(writer, count))
        for (unsigned i = 0; i < count; i++)
            writer->data[writer->used++] = (campaign_octet)((value >> (8u * i)) & 0xFFu);
}

void campaign_put_u8(struct campaign_writer *writer, uint32_t value)
{
    put(writer, value, 1);
}

void campaign_put_u16(struct campaign_writer *writer, uint32_t value)
{
    put(writer, value, 2);
}

void campaign_put_u32(struct campaign_writer *writer, uint32_t value)
{
    put(writer, value, 4);
}

void campaign_put_f64(struct campaign_writer *writer, double value)
{
    uint64_t bits;
    memcpy(&bits, &value, sizeof bits);
    put(writer, bits, 8);
}

void campaign_put_octets(struct campaign_writer *writer, const campaign_octet *data, size_t count)
{
    if (count > 0 && fits(writer, count)) {
        memcpy(writer->data + writer->used, data, count * sizeof *data);
        writer->used += count;
    }
}

static void put_text(struct campaign_writer *writer, const char *text, unsigned width, size_t most)
{
    const size_t length = text == NULL ? 0 : strlen(text);
    if (length > most) {
        writer->failed = true;
        return;
    }
    put(writer, length, width);
    for (size_t i = 0; i < length; i++)
        put(writer, (unsigned char)text[i], 1);
}

void campaign_put_short(struct campaign_writer *writer, const char *text)
{
    put_text(writer, text, 1, 0xFFu);
}

void campaign_put_long(struct campaign_writer *writer, const char *text)
{
    put_text(writer, text, 2, 0xFFFFu);
}

static uint64_t get(struct campaign_reader *reader, unsigned count)
{
    const campaign_octet *data = campaign_get_octets(reader, count);
    uint64_t value = 0;
    for (unsigned i = 0; data != NULL && i < count; i++)
        value |= (uint64_t)(data[i] & 0xFFu) << (8u * i);
    return value;
}

uint32_t campaign_get_u8(struct campaign_reader *reader)
{
    return (uint32_t)get(reader, 1);
}

uint32_t campaign_get_u16(struct campaign_reader *reader)
{
    return (uint32_t)get(reader, 2);
}

uint32_t campaign_get_u32(struct campaign_reader *reader)
{
    return (uint32_t)get(reader, 4);
}

uint64_t campaign_get_u64(struct campaign_reader *reader)
{
    return get(reader, 8);
}

double campaign_get_f64(struct campaign_reader *reader)
{
    const uint64_t bits = get(reader, 8);
    double value;
    if (((bits >> 52) & 0x7FFu) == 0x7FFu) {
        reader->failed = true;
        return 0.0;
    }
    memcpy(&value, &bits, sizeof value);
    return value;
}

const campaign_octet *campaign_get_octets(struct campaign_reader *reader, size_t count)
{
    if (reader->failed || count > reader->size - reader->at) {
        reader->failed = true;
        return NULL;
    }
    reader->at += count;
    return reader->data + (reader->at - count);
}

const campaign_octet *campaign_get_short(struct campaign_reader *reader, size_t *length)
{
    const campaign_octet *text;
    *length = campaign_get_u8(reader);
    text = campaign_get_octets(reader, *length);
    if (text != NULL && campaign_is_utf8(text, *length))
        return text;
    reader->failed = true;
    *length = 0;
    return NULL;
}

bool campaign_is_whole(const struct campaign_reader *reader)
{
    return !reader->failed && reader->at == reader->size;
}

/* No overlong forms, no surrogates, nothing beyond U+10FFFF (RFC 3629). */
bool campaign_is_utf8(const campaign_octet *data, size_t count)
{
    size_t i = 0;
    while (i < count) {
        const unsigned lead = data[i] & 0xFFu;
        unsigned more, low = 0x80u, high = 0xBFu;
        if (lead < 0x80u)
            more = 0;
        else if (lead >= 0xC2u && lead <= 0xDFu)
            more = 1;
        else if (lead >= 0xE0u && lead <= 0xEFu)
            more = 2;
        else if (lead >= 0xF0u && lead <= 0xF4u)
            more = 3;
        else
            return false;
        if (lead == 0xE0u)
            low = 0xA0u;
        else if (lead == 0xEDu)
            high = 0x9Fu;
        else if (lead == 0xF0u)
            low = 0x90u;
        else if (lead == 0xF4u)
            high = 0x8Fu;
        if (more > count - i - 1u)
            return false;
        for (unsigned k = 1; k <= more; k++) {
            const unsigned next = data[i + k] & 0xFFu;
            if (next < low || next > high)
                return false;
            low = 0x80u;
            high = 0xBFu;
        }
        i += 1u + more;
    }
    return true;
}

void campaign_keep_text(char *out, size_t most, const campaign_octet *text, size_t length)
{
    size_t kept = 0;
    if (length > most)
        length = most;
    while (length > 0 && !campaign_is_utf8(text, length))
        length--; /* not through the middle of a character */
    while (kept < length && (text[kept] & 0xFFu) != 0u) {
        out[kept] = (char)(text[kept] & 0xFFu);
        kept++;
    }
    out[kept] = '\0';
}

uint32_t campaign_get_safe(const campaign_octet *body, size_t length, char *host, size_t most)
{
    struct campaign_reader reader = {body, length, 0, false};
    const uint32_t session = length > 0 ? campaign_get_u32(&reader) : 0;
    size_t count = 0;
    const campaign_octet *text =
        reader.at < reader.size ? campaign_get_short(&reader, &count) : NULL;
    const bool whole = campaign_is_whole(&reader);
    campaign_keep_text(host, most, text, whole ? count : 0);
    return whole ? session : 0;
}

size_t campaign_frame_encode(unsigned kind, unsigned sequence, const campaign_octet *body,
                             size_t length, campaign_octet *out)
{
    campaign_octet content[CAMPAIGN_MAX_BODY + CAMPAIGN_OVERHEAD];
    struct campaign_writer writer = {content, sizeof content / sizeof *content, 0, false};
    size_t used;
    if (length > CAMPAIGN_MAX_BODY)
        return 0;
    campaign_put_u8(&writer, CAMPAIGN_FRAME_VERSION);
    campaign_put_u8(&writer, kind);
    campaign_put_u16(&writer, sequence);
    campaign_put_octets(&writer, body, length);
    campaign_put_u32(&writer, campaign_crc32(0, content, writer.used));
    out[0] = 0;
    used = 1u + campaign_cobs_encode(content, writer.used, out + 1);
    out[used++] = 0;
    return used;
}

void campaign_decoder_init(struct campaign_decoder *decoder)
{
    memset(decoder, 0, sizeof *decoder);
}

static bool take(struct campaign_decoder *decoder, struct campaign_frame *frame)
{
    struct campaign_counts *counts = &decoder->counts;
    campaign_octet *content = decoder->buffer;
    const size_t length = campaign_cobs_decode(content, decoder->used, content);
    struct campaign_reader reader = {content, length, 0, false};
    struct campaign_reader checksum = {content, length, 0, false};
    if (length == 0 && !(decoder->used == 1 && content[0] == 1u)) {
        counts->bad_cobs++;
        return false;
    }
    if (length < CAMPAIGN_OVERHEAD) {
        counts->too_short++;
        return false;
    }
    if (length > CAMPAIGN_MAX_BODY + CAMPAIGN_OVERHEAD) {
        counts->too_long++;
        return false;
    }
    checksum.at = length - 4u;
    if (campaign_get_u32(&checksum) != campaign_crc32(0, content, length - 4u)) {
        counts->bad_crc++;
        return false;
    }
    if (campaign_get_u8(&reader) != CAMPAIGN_FRAME_VERSION) {
        counts->wrong_version++;
        return false;
    }
    frame->kind = campaign_get_u8(&reader);
    frame->sequence = campaign_get_u16(&reader);
    frame->body = content + CAMPAIGN_HEADER;
    frame->length = length - CAMPAIGN_OVERHEAD;
    counts->good++;
    return true;
}

bool campaign_decoder_push(struct campaign_decoder *decoder, campaign_octet octet,
                           struct campaign_frame *frame)
{
    bool good = false;
    if ((octet & 0xFFu) != 0u) {
        if (decoder->used == CAMPAIGN_MAX_ENCODED)
            decoder->overlong = true; /* counted once, when its delimiter comes */
        else
            decoder->buffer[decoder->used++] = (campaign_octet)(octet & 0xFFu);
        return false;
    }
    if (decoder->overlong)
        decoder->counts.too_long++;
    else if (decoder->used > 0)
        good = take(decoder, frame);
    decoder->used = 0;
    decoder->overlong = false;
    return good;
}

uint32_t campaign_bad_frames(const struct campaign_counts *counts)
{
    return counts->bad_cobs + counts->too_short + counts->too_long + counts->bad_crc
           + counts->wrong_version;
}
