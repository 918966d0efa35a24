#include "passages.h"

/* Where a power changes no flow, Pa: blow-offs of cars see 1 to 100 bar. */
static const double S_0 = 1e6;

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
    df_flow f = {0.0, 0.0, {0.0}};
    const double p_open = law->of[DF_OPENING], R = law->of[DF_R], S = law->of[DF_S];
    const double u = D - p_open, width = law->of[DF_WIDTH], power = law->of[DF_POWER];
    double s, by_D, by_open, by_width = 0.0;
    if (width > 0.0) {
        double high, low, high_slope, low_slope, high_width, low_width;
        soft_plus(u / width, &high, &high_slope, &high_width);
        soft_plus(-p_open / width, &low, &low_slope, &low_width);
        s = width * (high - low);
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
            f.by[DF_OPENING] = -f.by_D;
            f.by[DF_R] = -0.5 / (S * S);
            f.by[DF_S] = -f.w / S;
            return f;
        }
        s = u * u / root;
        by_D = u * (u * u + 2.0 * eps * eps) / (square * root);
        by_open = -by_D;
    }
    double more = 1.0, by_power = 0.0;
    if (power > 0.0 && s > 0.0) {
        const double inverse = 1.0 / power, raised = S_0 * pow(s / S_0, inverse);
        by_power = -raised * inverse * inverse * log(s / S_0);
        more = inverse * raised / s;
        s = raised;
    }
    const double r = sqrt(R * R + 4.0 * S * S * s), inverse = 1.0 / r;
    f.w = 2.0 * s / (R + r);
    f.by_D = by_D * more * inverse;
    f.by[DF_OPENING] = by_open * more * inverse;
    f.by[DF_R] = -f.w * inverse;
    f.by[DF_S] = -2.0 * S * f.w * f.w * inverse;
    f.by[DF_WIDTH] = by_width * more * inverse;
    f.by[DF_POWER] = by_power * inverse;
    return f;
}

df_flow df_passage_flow(const df_passage_law *law, double D, double eps)
{
    if (D >= 0.0 || !law->two_way) {
        return open_flow(law, D, eps);
    }
    df_flow f = open_flow(law, -D, eps);
    f.w = -f.w;
    for (int i = 0; i < DF_TERMS; i++)
        f.by[i] = -f.by[i];
    return f;
}

double df_passage_drop(const df_passage_law *law, double w, double eps)
{
    const double S = law->of[DF_S], power = law->of[DF_POWER];
    const double size = fabs(w), raised = size * (law->of[DF_R] + S * S * size);
    const double s = power > 0.0 ? S_0 * pow(raised / S_0, power) : raised;
    const double u = sqrt(0.5 * s * (s + sqrt(s * s + 4.0 * eps * eps)));
    return copysign(law->of[DF_OPENING] + u, w);
}
