// Directional albedos of GGX microfacets that follow one bounce only, from tables made by native/tools/make_ggx_tables.py.
// Roughness is √α; cos_o is the view's cosine. Leaves out anisotropy: √(αx αy) stands for it, as in Blender.
#pragma once

namespace gi {

struct GgxEnergy {
  float directional, mean;  // albedo at cos_o, and its cosine-weighted mean over the hemisphere
};
GgxEnergy ggx_energy(float roughness, float cos_o);                   // white facets, reflection only
GgxEnergy ggx_glass_energy(float roughness, float cos_o, float ior);  // dielectric facets, both sides
// Where between f0 and f90 the albedo lies: Schlick's curve with this exponent; the real curve of a dielectric.
float ggx_schlick_weight(float roughness, float cos_o, float exponent);
float ggx_dielectric_weight(float roughness, float cos_o, float ior);

}  // namespace gi
