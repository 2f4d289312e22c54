/* Whether what is measured keeps the limits of a trial: the same judgement, to the bit, as the
 * host's (campaign/physics/limit_watch.py says why it is what it is).
 *
 * Angle, drive torque and motor current are judged at every sample, the rate by its mean over the
 * last `rate_time`, because a differenced encoder shows one count per sample. `rate_time` is cut to
 * 1 % of `angle` over `rate`: the axis then cannot go further than 2 % of the angle limit for it.
 * Before the first sample the axis was at rest.
 */
#ifndef CAMPAIGN_LIMITS_H
#define CAMPAIGN_LIMITS_H

#include <stddef.h>

/* `limits.*` of a SET, SI: rad, rad/s, s, N m at the load, A; all above 0. */
struct campaign_limits {
    double angle, rate, rate_time, torque, current;
};

/* One sample, SI. What has no sensor is 0. */
struct campaign_measured {
    double angle, rate, torque, current;
};

enum campaign_verdict {
    CAMPAIGN_WITHIN,
    CAMPAIGN_ANGLE_BROKEN,
    CAMPAIGN_RATE_BROKEN,
    CAMPAIGN_TORQUE_BROKEN,
    CAMPAIGN_CURRENT_BROKEN,
    CAMPAIGN_UNDEFINED /* infinite or not a number: the trial has diverged */
};

struct campaign_limit_watch {
    struct campaign_limits limits;
    double beyond;       /* the sum of rates that breaks the limit */
    double gained, left; /* of this window so far; of the window before it, what has not gone yet */
    double *ring;
    size_t count, next;
};

/* Samples over which the rate is averaged at `sample_rate` (Hz): so many `ring` has to have. */
size_t campaign_limits_samples(const struct campaign_limits *limits, double sample_rate);

/* Once per trial, at ARM. Returns 0 and watches nothing when the ring is too small or a limit is
 * not above 0: refuse to arm then. Else the samples of campaign_limits_samples(). */
size_t campaign_limits_init(struct campaign_limit_watch *watch,
                            const struct campaign_limits *limits, double sample_rate,
                            double *ring, size_t ring_samples);

/* Once per sample of the recording, in its order, also from an interrupt: a handful of additions.
 * The sample that is not CAMPAIGN_WITHIN is the last one of the trial. */
enum campaign_verdict campaign_limits_check(struct campaign_limit_watch *watch,
                                            const struct campaign_measured *measured);

#endif
