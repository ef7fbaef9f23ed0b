// Airy's sum cut after three round trips in the film; amplitudes by Fresnel, sensitivities from thin_film_table.inc.
// Leaves out primaries other than Rec. 709.
#include "shading/lobes/thin_film.h"

#include <complex>

#include "shading/lobes/fresnel.h"

namespace gi {
namespace {

#include "shading/lobes/thin_film_table.inc"

using Complex = std::complex<float>;

// Reflectance and phase factor of one polarisation.
struct Wave {
  float reflectance = 1.0f;
  Complex phase{1.0f, 0.0f};
};
struct Waves {
  Wave s, p;
};

Wave to_wave(Complex numerator, Complex denominator) {
  // a/b = a b* / |b|²: the phase needs no division of complex numbers.
  const Complex r = numerator * std::conj(denominator);
  const float d = std::norm(denominator), m = std::abs(r);
  return {d > 0.0f ? std::norm(numerator) / d : 1.0f, m > 0.0f ? r * (1.0f / m) : Complex(1.0f, 0.0f)};
}

// From a medium of index `near` into one of index n + ik. [Born & Wolf 1999, §14.4.1]
Waves reflect_waves(float cos_i, float near, float n, float k) {
  const float t = n * n - k * k - near * near * (1.0f - cos_i * cos_i), r = std::sqrt(t * t + sqr(2.0f * n * k));
  const Complex far{std::sqrt(std::max(0.5f * (r + t), 0.0f)), std::sqrt(std::max(0.5f * (r - t), 0.0f))};  // (n + ik) cos θt
  const Complex a = Complex{n * n - k * k, 2.0f * n * k} * cos_i, b = far * near;
  return {to_wave(near * cos_i - far, near * cos_i + far), to_wave(a - b, a + b)};
}

float f82_reflectance(float cos_i, float near, const FilmSubstrate& m) {
  const float n = m.n / near, k2 = sqr(m.k / near), f0 = (sqr(n - 1.0f) + k2) / (sqr(n + 1.0f) + k2);
  const float f = 6.0f / 7.0f, f5 = f * f * f * f * f, b = (lerp(f0, 1.0f, f5) - m.f82) * (7.0f / (f5 * f));
  return Fresnel::f82(cos_i, Rgb(f0), Rgb(b)).r();
}

Complex sensitivity(float difference, int channel) {
  // What is not a number must not become an index.
  const float x = difference > 0.0f ? std::min(difference * (1.0f / kThinFilmStep), 510.0f) : 0.0f;
  const int i = int(x);
  const float t = x - float(i), *a = kThinFilm[i] + 2 * channel, *b = kThinFilm[i + 1] + 2 * channel;
  return {lerp(a[0], b[0], t), lerp(a[1], b[1], t)};
}

// [Belcour & Barla 2017, eq. 10]; the way back into the film from its top turns the phase of the way down by half a turn.
float airy(const Wave& top, const Wave& bottom, float difference, int channel) {
  const float through = 1.0f - top.reflectance, both = top.reflectance * bottom.reflectance;
  if (both >= 1.0f) return 1.0f;
  const float mean = through * through * bottom.reflectance / (1.0f - both);
  const Complex turn = bottom.phase * -top.phase.real();
  float sum = top.reflectance + mean, c = mean - through;
  Complex phase = turn;
  for (int m = 1; m <= 3; ++m) {
    c *= std::sqrt(both);
    sum += 2.0f * c * (phase * sensitivity(float(m) * difference, channel)).real();
    phase *= turn;
  }
  return sum;
}

struct Geometry {
  Waves top;
  float ior, cos_film, difference;
  bool total;  // reflection at the film's top
};
Geometry enter_film(float cos_i, const ThinFilm& film) {
  // Under a nanometre there is no interference: the film fades away.
  const float t = clamp01(film.thickness), ior = lerp(1.0f, film.ior, t * t * (3.0f - 2.0f * t));
  const float cos2 = 1.0f - (1.0f - cos_i * cos_i) / (ior * ior);
  if (cos2 <= 0.0f) return {{}, ior, 0.0f, 0.0f, true};
  const float cos_film = std::sqrt(cos2);
  return {reflect_waves(cos_i, 1.0f, ior, 0.0f), ior, cos_film, 2.0f * ior * film.thickness * cos_film, false};
}

}  // namespace

float film_reflectance(float cos_i, const ThinFilm& film, const FilmSubstrate& substrate, int channel) {
  const Geometry g = enter_film(cos_i, film);
  if (g.total) return 1.0f;
  Waves bottom = reflect_waves(g.cos_film, g.ior, substrate.n, substrate.k);
  if (substrate.f82 >= 0.0f) bottom.s.reflectance = bottom.p.reflectance = f82_reflectance(g.cos_film, g.ior, substrate);
  return clamp01(0.5f * (airy(g.top.s, bottom.s, g.difference, channel) + airy(g.top.p, bottom.p, g.difference, channel)));
}

Rgb film_reflectance(float cos_i, const ThinFilm& film, float ior) {
  const Geometry g = enter_film(cos_i, film);
  if (g.total) return Rgb(1.0f);
  const Waves bottom = reflect_waves(g.cos_film, g.ior, ior, 0.0f);
  Rgb f;
  for (int i = 0; i < 3; ++i) f[i] = clamp01(0.5f * (airy(g.top.s, bottom.s, g.difference, i) + airy(g.top.p, bottom.p, g.difference, i)));
  return f;
}

}  // namespace gi
