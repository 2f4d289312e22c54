/* Items of a SET: named values, and slices of arrays. */
#include "campaign_state.h"

#include <string.h>

static bool is_name(const campaign_octet *data, size_t count)
{
    bool word = false; /* something stands since the last dot */
    for (size_t i = 0; i < count; i++) {
        const unsigned c = data[i] & 0xFFu;
        const bool letter = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z')
                            || (c >= '0' && c <= '9') || c == '_' || c == '-';
        if (!letter && !(c == '.' && word))
            return false;
        word = letter;
    }
    return word;
}

static void get_array(struct campaign_reader *reader, struct campaign_item *item)
{
    item->total = campaign_get_u32(reader);
    item->offset = campaign_get_u32(reader);
    item->count = campaign_get_u8(reader);
    if (item->count > CAMPAIGN_LONGEST_SLICE || item->offset > item->total
        || item->count > item->total - item->offset || (item->count == 0 && item->total > 0)) {
        reader->failed = true;
        return;
    }
    for (uint32_t i = 0; i < item->count; i++)
        item->values[i] = campaign_get_f64(reader);
}

void campaign_get_item(struct campaign_reader *reader, struct campaign_item *item)
{
    const size_t length = campaign_get_u8(reader);
    const campaign_octet *name = campaign_get_octets(reader, length);
    uint32_t truth;
    memset(item, 0, sizeof *item);
    if (name == NULL || length > CAMPAIGN_LONGEST_NAME || !is_name(name, length)) {
        reader->failed = true;
        return;
    }
    for (size_t i = 0; i < length; i++)
        item->name[i] = (char)(name[i] & 0xFFu);
    item->tag = (enum campaign_tag)campaign_get_u8(reader);
    switch (item->tag) {
    case CAMPAIGN_F64:
        item->f64 = campaign_get_f64(reader);
        break;
    case CAMPAIGN_I64:
        item->i64 = campaign_get_u64(reader);
        break;
    case CAMPAIGN_BOOL:
        truth = campaign_get_u8(reader);
        item->truth = truth == 1u;
        reader->failed = reader->failed || truth > 1u;
        break;
    case CAMPAIGN_TEXT:
        item->text_length = campaign_get_u16(reader);
        item->text = campaign_get_octets(reader, item->text_length);
        if (item->text == NULL || item->text_length > CAMPAIGN_LONGEST_TEXT
            || !campaign_is_utf8(item->text, item->text_length))
            reader->failed = true;
        break;
    case CAMPAIGN_F64_ARRAY:
        get_array(reader, item);
        break;
    default:
        reader->failed = true;
    }
}
