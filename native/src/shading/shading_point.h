// The point being shaded, as node programs and integrators see it. Filled by Scene::shading_point.
#pragma once
#include "core/vec.h"

namespace gi {

// The kind of ray that reached the point, as Blender's Light Path node asks. Bits add up.
enum RayKind : uint32_t {
  kRayCamera = 1,
  kRayShadow = 2,
  kRayDiffuse = 4,
  kRayGlossy = 8,
  kRayTransmission = 16,
  kRaySingular = 32,
  kRayReflection = 64,
  kRayVolume = 128,
};

// Lobes that a diffuse bounce may be told not to see (Blender's caustics switches).
enum CausticFlags : uint8_t { kNoReflectiveCaustics = 1, kNoRefractiveCaustics = 2 };

struct PathState {  // of the ray that arrived
  uint32_t kind = kRayCamera;
  // Small, since the state is copied at every bounce; Blender's limits end at 1024.
  int16_t depth = 0, diffuse_depth = 0, glossy_depth = 0, transmission_depth = 0, transparent_depth = 0, portal_depth = 0, volume_depth = 0;
  float ray_length = 0;
  uint8_t without = 0;  // CausticFlags: lobes that are left out at the next surface
  bool after_diffuse = false;  // somewhere on the way a surface scattered diffusely
  float least_pdf = 1e30f;  // of the directions so far, per steradian: how blurred the path's last surface is seen
};

inline constexpr uint32_t kNoId = 0xffffffffu;

struct ShadingPoint {
  Vec3 position;       // world, metres
  Vec3 wo;             // unit, towards where the ray came from
  Vec3 ng, ns;         // geometric and interpolated normal, unit, both turned towards wo
  bool backfacing = false;
  bool inside = false;   // within a volume: what the mesh knows of its surface is not asked
  Vec3 object_position;  // in the instance's own space
  uint32_t instance = kNoId, mesh = kNoId, triangle = kNoId;  // kNoId on the world and on lamps
  uint32_t strand = kNoId;  // which of the curves or points of a mesh of those; `triangle` is then the curve's segment, or the point
  float b1 = 0, b2 = 0;  // barycentrics of the triangle's 2nd and 3rd corner; along the segment, and across a ribbon from −1 to 1
  float shift1 = 0, shift2 = 0;  // how far bumps have moved the barycentrics
  float footprint = 0;    // radius of the pixel on the surface, metres: what Bump steps by; 0 where the path has none
  float undisplaced_step = 0;  // seen where it was before true displacement, with steps that much as long; 0: seen where it is
  PathState path;
  const Affine* lamp_to_world = nullptr;  // on lamps
  const float* instance_info = nullptr;  // see scene/scene.h InstanceInfo
};

}  // namespace gi
