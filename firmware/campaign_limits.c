/* See campaign_limits.h. Doubles throughout, and sums in one order: the host computes the same. */
#include "campaign_limits.h"

#include <float.h>
#include <stdbool.h>

#define SHARE 0.01    /* of the angle limit, that the rate limit allows in the judging time */
#define ROUNDING 1e-9 /* relative: right at the limit is allowed, however it was summed */

static double magnitude(double value)
{
    return value < 0.0 ? -value : value;
}

static bool is_finite(double value)
{
    return magnitude(value) <= DBL_MAX; /* false for what is not a number */
}

static bool is_limit(double value)
{
    return value > 0.0 && is_finite(value);
}

size_t campaign_limits_samples(const struct campaign_limits *limits, double sample_rate)
{
    const double allowed = SHARE * limits->angle / limits->rate;
    const double longest = limits->rate_time < allowed ? limits->rate_time : allowed;
    const double samples = longest * sample_rate + ROUNDING;
    if (!(samples >= 1.0))
        return 1;
    return samples < (double)((size_t)-1 / 2) ? (size_t)samples : (size_t)-1 / 2;
}

size_t campaign_limits_init(struct campaign_limit_watch *watch,
                            const struct campaign_limits *limits, double sample_rate,
                            double *ring, size_t ring_samples)
{
    watch->limits = *limits;
    watch->ring = ring;
    watch->count = watch->next = 0;
    watch->gained = watch->left = watch->beyond = 0.0;
    if (!is_limit(limits->angle) || !is_limit(limits->rate) || !is_limit(limits->rate_time)
        || !is_limit(limits->torque) || !is_limit(limits->current) || !is_limit(sample_rate))
        return 0;
    const size_t count = campaign_limits_samples(limits, sample_rate);
    if (ring == NULL || count > ring_samples)
        return 0;
    for (size_t i = 0; i < count; i++)
        ring[i] = 0.0;
    watch->count = count;
    watch->beyond = limits->rate * (double)count * (1.0 + ROUNDING);
    return count;
}

enum campaign_verdict campaign_limits_check(struct campaign_limit_watch *watch,
                                            const struct campaign_measured *measured)
{
    if (!is_finite(measured->angle) || !is_finite(measured->rate) || !is_finite(measured->torque)
        || !is_finite(measured->current) || watch->count == 0)
        return CAMPAIGN_UNDEFINED;
    watch->gained += measured->rate;
    watch->left -= watch->ring[watch->next];
    watch->ring[watch->next] = measured->rate;
    const double sum = watch->left + watch->gained;
    if (++watch->next == watch->count) {
        watch->next = 0;
        watch->left = watch->gained; /* summed anew: rounding does not add up */
        watch->gained = 0.0;
    }
    if (magnitude(measured->angle) > watch->limits.angle)
        return CAMPAIGN_ANGLE_BROKEN;
    if (magnitude(sum) > watch->beyond)
        return CAMPAIGN_RATE_BROKEN;
    if (magnitude(measured->torque) > watch->limits.torque)
        return CAMPAIGN_TORQUE_BROKEN;
    if (magnitude(measured->current) > watch->limits.current)
        return CAMPAIGN_CURRENT_BROKEN;
    return CAMPAIGN_WITHIN;
}
