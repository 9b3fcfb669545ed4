// Refraction and reflection at an interface, as in refraction/optics.py.

// The direction behind an interface, its share of the energy, and whether the ray passed.
bool refract(Vector *direction, Vector normal, REAL ratio, REAL *weight)
{
    const REAL along = dot3(*direction, normal);
    const REAL cosine = size_of(along);
    const REAL square = 1 - ratio * ratio * (1 - cosine * cosine);
    const bool passed = !(square < 0);
    Vector bent;
    if (passed) {
        const REAL behind = sqrt(square);
        const REAL s = (ratio * cosine - behind) / (ratio * cosine + behind);
        const REAL p = (ratio * behind - cosine) / (ratio * behind + cosine);
        *weight *= 1 - R(0.5) * (s * s + p * p);
        bent = moved(scaled(ratio, *direction), normal, (behind - ratio * cosine) * copysign(R(1), along));
    } else {
        bent = moved(*direction, normal, -2 * along);
    }
    // A unit vector but for rounding; one step of Newton's method keeps it one.
    *direction = scaled(R(1.5) - R(0.5) * dot3(bent, bent), bent);
    return passed;
}

Vector unit_normal(Vector gradient, Vector direction)
{
    const REAL square = dot3(gradient, gradient);
    return square == 0 ? direction : scaled(1 / sqrt(square), gradient);
}
