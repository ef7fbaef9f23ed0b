// The Principled BSDF of Blender 5.2 as layers of lobes: sheen, coat, metal, glass, specular, diffuse.
// Leaves out subsurface scattering: its share is diffuse with the same albedo (transmitting, too, where the wall is thin).
#pragma once
#include "shading/closures.h"

namespace gi {

struct PrincipledTop {  // the layers that lie over everything, the emission included
  float sheen_weight, sheen_roughness;
  Rgb sheen_tint;
  float coat_weight, coat_roughness, coat_ior;
  Rgb coat_tint;
  Vec3 coat_normal;  // zero: the shading normal
};

struct Principled {
  Rgb base_color;
  float metallic, roughness, ior;
  bool thin_wall;
  Vec3 normal;  // unit
  float diffuse_roughness, subsurface_weight, subsurface_anisotropy;
  float specular_level;
  Rgb specular_tint;
  float anisotropic, anisotropic_rotation;  // rotation in turns
  Vec3 tangent;                             // zero: none
  float transmission, film_thickness, film_ior;  // nanometres
  bool preserve_energy;                     // Multiscatter GGX
  PrincipledTop top;
};

// The weight that sheen and coat leave for what lies below; adds their lobes if `add`.
Rgb add_top_layers(ShadeState& s, const PrincipledTop& p, Vec3 normal, Rgb weight, bool add);
void add_principled(ShadeState& s, const Principled& p, Rgb weight);

}  // namespace gi
