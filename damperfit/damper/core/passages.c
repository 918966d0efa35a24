#include "passages.h"

/* ln(1 + e^z), its slope, and its derivative by the width in units of the width. */
static void soft_plus(double z, double *value, double *slope, double *by_width)
{
    const double e = exp(-fabs(z));
    *value = (z > 0.0 ? z : 0.0) + log1p(e);
    *slope = (z > 0.0 ? 1.0 : e) / (1.0 + e);
    *by_width = *value - z * *slope;
}

/* One direction, D > 0. */
static df_flow open_flow(const df_passage_law *law, double D, double eps)
{
    df_flow f = {0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0};
    const double u = D - law->p_open, R = law->R, S = law->S;
    double s, by_D, by_open, by_width = 0.0;
    if (law->width > 0.0) {
        double high, low, high_slope, low_slope, high_width, low_width;
        soft_plus(u / law->width, &high, &high_slope, &high_width);
        soft_plus(-law->p_open / law->width, &low, &low_slope, &low_width);
        s = law->width * (high - low);
        by_D = high_slope;
        by_open = low_slope - high_slope;
        by_width = high_width - low_width;
        if (!(s > 0.0))
            return f;
    } else {
        if (!(u > 0.0))
            return f;
        const double square = u * u + eps * eps, root = sqrt(square);
        if (R == 0.0) { /* the pure orifice, whose slope stays finite at the opening */
            const double fourth = sqrt(root);
            f.w = u / (fourth * S);
            f.by_D = (u * u + 2.0 * eps * eps) / (2.0 * S * square * fourth);
            f.by_open = -f.by_D;
            f.by_R = -0.5 / (S * S);
            f.by_S = -f.w / S;
            return f;
        }
        s = u * u / root;
        by_D = u * (u * u + 2.0 * eps * eps) / (square * root);
        by_open = -by_D;
    }
    const double more = 1.0 + 2.0 * law->lift * s, by_lift = s * s;
    s += law->lift * by_lift;
    const double r = sqrt(R * R + 4.0 * S * S * s), inverse = 1.0 / r;
    f.w = 2.0 * s / (R + r);
    f.by_D = by_D * more * inverse;
    f.by_open = by_open * more * inverse;
    f.by_width = by_width * more * inverse;
    f.by_lift = by_lift * inverse;
    f.by_R = -f.w * inverse;
    f.by_S = -2.0 * S * f.w * f.w * inverse;
    return f;
}

df_flow df_passage_flow(const df_passage_law *law, double D, double eps)
{
    if (D >= 0.0 || !law->two_way) {
        return open_flow(law, D, eps);
    }
    df_flow f = open_flow(law, -D, eps);
    f.w = -f.w;
    f.by_open = -f.by_open;
    f.by_R = -f.by_R;
    f.by_S = -f.by_S;
    f.by_width = -f.by_width;
    f.by_lift = -f.by_lift;
    return f;
}

double df_passage_drop(const df_passage_law *law, double w, double eps)
{
    const double size = fabs(w), lifted = size * (law->R + law->S * law->S * size);
    const double s = 2.0 * lifted / (1.0 + sqrt(1.0 + 4.0 * law->lift * lifted));
    const double u = sqrt(0.5 * s * (s + sqrt(s * s + 4.0 * eps * eps)));
    return copysign(law->p_open + u, w);
}
