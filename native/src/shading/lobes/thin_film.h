// Reflectance of a dielectric or a metal under a thin film: interference, per RGB channel, by Airy's sum in Fourier space.
// [Belcour & Barla 2017, "A practical extension to microfacet theory for the modeling of varying iridescence"]
#pragma once
#include "core/vec.h"

namespace gi {

struct ThinFilm {
  float thickness = 0.0f;  // nanometres
  float ior = 1.0f;        // over that of the near side
  explicit operator bool() const { return thickness > 0.1f; }
};

// What the film lies on, one channel: index n + ik over the near side's. A reflectance at cos θ = 1/7, where it is not negative, makes
// the reflectance of the substrate follow the F82 model.
struct FilmSubstrate {
  float n = 1.0f, k = 0.0f, f82 = -1.0f;
};

float film_reflectance(float cos_i, const ThinFilm& film, const FilmSubstrate& substrate, int channel);
// A dielectric substrate: the same index in all channels.
Rgb film_reflectance(float cos_i, const ThinFilm& film, float ior);

}  // namespace gi
