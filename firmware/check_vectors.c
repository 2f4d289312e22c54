/* Check the reference against vectors.txt (its first argument): exit status 0 when all agree. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "campaign_wire.h"

#define MOST 4096u

static int digit(char c)
{
    if (c >= '0' && c <= '9')
        return c - '0';
    return c >= 'a' && c <= 'f' ? c - 'a' + 10 : -1;
}

static size_t octets(const char *text, campaign_octet *out)
{
    size_t count = 0;
    while (text != NULL && count < MOST && digit(text[0]) >= 0 && digit(text[1]) >= 0) {
        out[count++] = (campaign_octet)(digit(text[0]) * 16 + digit(text[1]));
        text += 2;
    }
    return count;
}

static bool equal(const campaign_octet *a, size_t m, const campaign_octet *b, size_t n)
{
    return m == n && memcmp(a, b, n * sizeof *a) == 0;
}

static bool check_cobs(const char *plain, const char *coded)
{
    static campaign_octet a[MOST], b[MOST], c[CAMPAIGN_COBS_LENGTH(MOST)];
    const size_t m = octets(plain, a), n = octets(coded, b);
    return equal(c, campaign_cobs_encode(a, m, c), b, n)
           && equal(c, campaign_cobs_decode(b, n, c), a, m);
}

static bool check_frame(const char *kind, const char *sequence, const char *body, const char *all)
{
    static campaign_octet a[MOST], b[MOST], c[CAMPAIGN_MAX_FRAME];
    static struct campaign_decoder decoder;
    struct campaign_frame frame = {0, 0, NULL, 0};
    const unsigned k = (unsigned)strtoul(kind, NULL, 10), s = (unsigned)strtoul(sequence, NULL, 10);
    const size_t m = octets(body, a), n = octets(all, b);
    int found = 0;
    campaign_decoder_init(&decoder);
    for (size_t i = 0; i < n; i++)
        if (campaign_decoder_push(&decoder, b[i], &frame))
            found++;
    return found == 1 && frame.kind == k && frame.sequence == s
           && equal(frame.body, frame.length, a, m) && equal(c, campaign_frame_encode(k, s, a, m, c), b, n);
}

static bool check_bad(const char *reason, const char *all)
{
    static campaign_octet b[MOST];
    static struct campaign_decoder decoder;
    const size_t n = octets(all, b);
    const struct campaign_counts *counts = &decoder.counts;
    struct campaign_frame frame;
    campaign_decoder_init(&decoder);
    for (size_t i = 0; i < n; i++)
        if (campaign_decoder_push(&decoder, b[i], &frame))
            return false;
    return campaign_bad_frames(counts) == 1
           && ((strcmp(reason, "bad_cobs") == 0 && counts->bad_cobs)
               || (strcmp(reason, "too_short") == 0 && counts->too_short)
               || (strcmp(reason, "too_long") == 0 && counts->too_long)
               || (strcmp(reason, "bad_crc") == 0 && counts->bad_crc)
               || (strcmp(reason, "wrong_version") == 0 && counts->wrong_version));
}

static bool check_safe(const char *body, const char *session, const char *host)
{
    static campaign_octet a[MOST], b[MOST];
    char found[256];
    const size_t m = octets(body, a), n = octets(host, b);
    return campaign_get_safe(a, m, found, sizeof found - 1u) == strtoul(session, NULL, 10)
           && strlen(found) == n && memcmp(found, b, n) == 0;
}

static bool check(char *word[6])
{
    static campaign_octet a[MOST];
    if (strcmp(word[0], "crc") == 0 && word[2] != NULL)
        return campaign_crc32(0, a, octets(word[1], a)) == strtoul(word[2], NULL, 16);
    if (strcmp(word[0], "cobs") == 0 && word[2] != NULL)
        return check_cobs(word[1], word[2]);
    if (strcmp(word[0], "frame") == 0 && word[4] != NULL)
        return check_frame(word[1], word[2], word[3], word[4]);
    if (strcmp(word[0], "safe") == 0 && word[3] != NULL)
        return check_safe(word[1], word[2], word[3]);
    if (strcmp(word[0], "bad") == 0 && word[2] != NULL)
        return check_bad(word[1], word[2]);
    return false;
}

int main(int count, char **arguments)
{
    static char line[4 * MOST];
    FILE *file = count == 2 ? fopen(arguments[1], "r") : NULL;
    unsigned at = 0, checked = 0, wrong = 0;
    if (file == NULL) {
        fputs("usage: check_vectors vectors.txt\n", stderr);
        return 2;
    }
    while (fgets(line, sizeof line, file) != NULL) {
        char *word[6] = {NULL};
        at++;
        word[0] = strtok(line, " \n");
        for (int i = 1; i < 6 && word[i - 1] != NULL; i++)
            word[i] = strtok(NULL, " \n");
        if (word[0] == NULL || word[0][0] == '#')
            continue;
        checked++;
        if (!check(word)) {
            wrong++;
            printf("line %u: the reference disagrees\n", at);
        }
    }
    (void)fclose(file);
    printf("%u vectors, %u wrong\n", checked, wrong);
    return wrong != 0 || checked == 0;
}
