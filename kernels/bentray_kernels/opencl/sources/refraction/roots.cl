// Roots of the field along a ray, as in isosurface/roots.py. DEEPEST: steps of a root finder.

#if HOW == CERTAIN
REAL newton(const Field *field, const Ray *ray, REAL target, REAL a, REAL value_a, REAL b, REAL value_b,
            REAL bend, REAL tolerance, Vector *gradient)
{
    REAL s = a + (b - a) * (target - value_a) / (value_b - value_a), last = 0;
    Vector before = {0, 0, 0};
    for (int n = 0; n < DEEPEST; ++n) {
        const REAL value = field_and_gradient_at(field, ray, s, gradient);
        const REAL slope = dot3(*gradient, ray->along);
        if ((value > target) == (value_b > value_a))
            b = s;
        else
            a = s;
        REAL step = (target - value) / slope;
        if (!(a <= s + step && s + step <= b)) {
            // Out of the bracket, or no slope to follow.
            step = R(0.5) * (a + b) - s;
        } else if (size_of(step) <= tolerance) {
            return s + step;
        } else if (n > 0 && R(0.5) * bend * step * step <= tolerance * size_of(slope)) {
            *gradient = moved(*gradient, moved(*gradient, before, -1), step / last);
            return s + step;
        }
        before = *gradient;
        last = step;
        s += step;
    }
    return s;
}
#endif

REAL brent(const Field *field, const Ray *ray, REAL target, REAL a, REAL value_a, REAL b, REAL value_b,
           REAL tolerance)
{
    REAL f_a = value_a - target, f_b = value_b - target;
    if (f_a == 0)
        return a;
    const REAL close = tolerance * size_of(f_b - f_a) / size_of(b - a);
    REAL c = a, f_c = f_a, step = b - a, last = b - a;
    for (int n = 0; n < DEEPEST; ++n) {
        if ((f_b > 0) == (f_c > 0)) {
            c = a;
            f_c = f_a;
            step = last = b - a;
        }
        if (size_of(f_c) < size_of(f_b)) {
            a = b;
            b = c;
            c = a;
            f_a = f_b;
            f_b = f_c;
            f_c = f_a;
        }
        const REAL half_way = R(0.5) * (c - b);
        if (size_of(half_way) <= tolerance || size_of(f_b) <= close)
            break;
        if (size_of(last) >= tolerance && size_of(f_a) > size_of(f_b)) {
            const REAL ratio = f_b / f_a;
            REAL p, q;
            if (a == c) {
                p = 2 * half_way * ratio;
                q = 1 - ratio;
            } else {
                const REAL u = f_a / f_c, v = f_b / f_c;
                p = ratio * (2 * half_way * u * (u - v) - (b - a) * (v - 1));
                q = (u - 1) * (v - 1) * (ratio - 1);
            }
            q = p > 0 ? -q : q;
            p = size_of(p);
            if (2 * p < lower(3 * half_way * q - size_of(tolerance * q), size_of(last * q))) {
                last = step;
                step = p / q;
            } else {
                last = step = half_way;
            }
        } else {
            last = step = half_way;
        }
        a = b;
        f_a = f_b;
        b += size_of(step) > tolerance ? step : copysign(tolerance, half_way);
        f_b = field_at(field, ray, b) - target;
    }
    return b;
}

#if HOW == ANALYTIC
REAL polished(REAL t, REAL c0, REAL c1, REAL c2, REAL c3)
{
    for (int n = 0; n < 2; ++n) {
        const REAL slope = c1 + t * (2 * c2 + t * 3 * c3);
        if (slope != 0)
            t -= (c0 + t * (c1 + t * (c2 + t * c3))) / slope;
    }
    return R(-1e-12) <= t && t <= R(1.0 + 1e-12) ? t : NONE;
}

REAL first_root_of_cubic(REAL c0, REAL c1, REAL c2, REAL c3)
{
    const REAL scale = upper(upper(size_of(c0), size_of(c1)), upper(size_of(c2), size_of(c3)));
    REAL first = NONE;
    if (size_of(c3) > R(1e-9) * scale) {
        const REAL p = c2 / (3 * c3), q = c1 / c3;
        const REAL third = (q - 3 * p * p) / 3;
        const REAL constant_part = (2 * p * p - q) * p + c0 / c3;
        const REAL discriminant = R(0.25) * constant_part * constant_part + third * third * third;
        if (discriminant > 0) {
            const REAL root = sqrt(discriminant);
            const REAL larger = cbrt(R(-0.5) * constant_part - copysign(root, constant_part));
            first = polished(larger - third / larger - p, c0, c1, c2, c3);
        } else {
            const REAL radius = sqrt(-third);
            const REAL cube = radius * radius * radius;
            const REAL cosine = radius > 0 ? R(-0.5) * constant_part / cube : 0;
            const REAL angle = acos(lower(upper(cosine, -1), 1)) / 3;
            for (int k = 0; k < 3; ++k) {
                const REAL t = 2 * radius * cos(angle + k * R(2.0943951023931954923)) - p;
                first = lower(first, polished(t, c0, c1, c2, c3));
            }
        }
    } else if (size_of(c2) > R(1e-12) * scale) {
        const REAL discriminant = c1 * c1 - 4 * c2 * c0;
        if (discriminant >= 0) {
            const REAL both = R(-0.5) * (c1 + copysign(sqrt(discriminant), c1));
            first = polished(both / c2, c0, c1, c2, c3);
            if (both != 0)
                first = lower(first, polished(c0 / both, c0, c1, c2, c3));
        }
    } else if (c1 != 0) {
        first = polished(-c0 / c1, c0, c1, c2, c3);
    }
    return first;
}
#endif
