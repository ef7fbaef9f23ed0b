// The scene that integrators trace: geometry, what it is made of and what can be asked at a point.
// Embree lives behind Accel (accel.h) and shows nowhere else. Light selection is in lights/.
#pragma once
#include <array>
#include <atomic>
#include <memory>
#include <optional>
#include <span>

#include "scene/accel.h"
#include "scene/scene_data.h"
#include "scene/strands.h"
#include "scene/tangents.h"
#include "shading/program.h"
#include "shading/resources.h"

namespace gi {

// Where a point was before true displacement, world space: the edges of its triangle, its normal, turned as the point's own, and that
// normal in object space, interpolated but not made unit nor turned to the viewer.
struct Undisplaced {
  Vec3 position, normal, e1, e2, object_normal;
};

// Gives instances of one mesh that displacement moves differently a mesh each.
void part_what_moves_differently(SceneData& data);

// One placed mesh, ready for shading.
struct Instance {
  uint32_t mesh = 0;
  Affine to_world, to_object;
  bool mirrored = false;     // negative determinant
  bool is_only = false;      // the mesh's only one
  bool world_space = false;  // the mesh's positions are already in world space
  bool world_normals = false;  // corner normals are made unit in world space before they are interpolated, not in object space
  const InstanceData* data = nullptr;
};

// For a scene that is edited: every mesh stays in object space with a tree of its own, so that what moves does not touch it, and what
// `before` made of meshes that are the same (MeshData::before) serves again. Traced a little slower than what does not move.
struct Editing {
  bool movable = false;
  const Scene* before = nullptr;  // movable, too
};

class Scene {
 public:
  // `embree` is the library to load. Throws InputError or DeviceError.
  Scene(SceneData data, std::unique_ptr<ShaderResources> resources, const std::string& embree, int threads, const Editing& editing = {});
  ~Scene();
  Scene(const Scene&) = delete;

  // Nearest hit of a ray of `visibility` (RayKind bits) within [t_min, t_max].
  std::optional<Hit> intersect(const Ray& ray, uint32_t visibility) const {
    count_ray();
    return accel_->intersect(ray, visibility);
  }
  // Of one instance alone, whoever sees it: for subsurface scattering and for the nodes that look at their own object.
  std::optional<Hit> intersect_instance(const Ray& ray, uint32_t instance) const {
    count_ray();
    return accel_->intersect_instance(ray, instance);
  }
  // Whether something that casts full shadows is in the way.
  bool occluded(const Ray& ray) const {
    count_ray();
    return accel_->occluded(ray, kRayShadow);
  }
  // Fraction of light that passes along a shadow ray: 0 or 1 for opaque scenes, programs decide for transparent surfaces.
  Rgb transmittance(const Ray& ray, const PathState& path) const;

  // Surfaces of objects that are filled with something, along a ray: all of them, nearest first, whoever sees them.
  void volume_hits(const Ray& ray, std::vector<Hit>& hits) const { accel_->all_hits(ray, kVolumeBit, hits); }
  // Adds what fills an object of material `material` at `point`.
  void add_medium(int material, ShadingPoint& point, Medium& medium) const;

  // What programs may ask. `ray` is the one that hit; `footprint` is the pixel's radius there, in metres.
  ShadingPoint shading_point(const Ray& ray, const Hit& hit, const PathState& path, float footprint = 0) const;
  // The point of triangle `triangle` at barycentrics (b1, b2), seen from direction `wo`: for light sampling and texels. Not of strands.
  ShadingPoint surface_point(uint32_t instance, uint32_t triangle, float b1, float b2, Vec3 wo, const PathState& path,
                             float footprint = 0) const;
  // The same point seen from `wo`. Ribbons turn.
  ShadingPoint turned(const ShadingPoint& point, Vec3 wo, const PathState& path) const;
  // Where a shadow ray towards `wi` starts: near the terminator of a smooth-shaded mesh lifted towards the surface that the
  // normals suggest, or the facets would show in the shadow. [Hanika 2021, "Hacking the shadow terminator"]
  Vec3 shadow_origin(const ShadingPoint& point, Vec3 wi) const;
  // The world as seen along `direction`.
  ShadingPoint world_point(Vec3 direction, const PathState& path) const;

  // Runs the material's program: lobes, emission and transparency.
  void shade(ShadingPoint& point, Bsdf& bsdf) const;
  Rgb emission(ShadingPoint& point) const;      // of the surface, towards point.wo
  Rgb transparency(ShadingPoint& point) const;  // of the surface, straight through
  // What AOV outputs of the surface, or of the world, add.
  void add_aovs(const ShadingPoint& point, std::span<float> aovs) const;
  Rgb world_radiance(Vec3 direction, const PathState& path) const;
  Rgb run_emission(int program, ShadingPoint& point) const;  // of a lamp's or the world's program

  int material_of(uint32_t instance, uint32_t triangle) const;  // index for material()
  const MaterialData& material(int i) const { return data_.materials[size_t(i)]; }
  std::span<const Instance> instances() const { return instances_; }
  const MeshData& mesh(uint32_t i) const { return data_.meshes[i]; }
  const SceneData& data() const { return data_; }
  void triangle_vertices(uint32_t instance, uint32_t triangle, Vec3 out[3]) const;  // world space
  Bounds bounds() const { return bounds_; }
  const ShaderResources& resources() const { return *resources_; }

  // The attribute in slot `slot` (SceneData::attribute_names; "" is the active UV map) at the point; falls back on object
  // and instancer attributes. Returns how many components it has; 0 if the object has none. Missing components: 0, alpha 1.
  int attribute(const ShadingPoint& point, int slot, float out[4]) const;
  bool active_uv(const ShadingPoint& point, float out[4]) const;  // the UV map that renders by default
  // Interpolated but not made unit, object space, not turned to the viewer; flat where the mesh has no normals.
  Vec3 smooth_object_normal(const ShadingPoint& point) const;
  // The tangent of the UV map in slot `slot`, interpolated but not made unit, object space. For the slots that ops of the
  // object's materials take tangents of; null if the object has no such map.
  std::optional<CornerTangent> uv_tangent(const ShadingPoint& point, int slot, bool undisplaced = false) const;

  // A strand's own at the point, in world space: towards its tip and, where that is asked for, as thick as it is (metres).
  struct StrandPlace {
    Vec3 center, along;
    float thickness = 0, own_thickness = 0;  // metres; in object space
  };
  StrandPlace strand_place(const ShadingPoint& point) const;
  bool is_ribbon(const ShadingPoint& point) const { return point.strand != kNoId && strands_[point.mesh]->is_ribbon(); }

  // Null where there is no true displacement.
  std::optional<Undisplaced> undisplaced(const ShadingPoint& point) const;
  // Whether rays can be traced already: not while the surface is being displaced.
  bool traceable() const { return accel_ != nullptr; }

  std::string embree_description() const { return accel_->description(); }
  size_t memory_bytes() const;  // geometry and acceleration structure
  uint64_t rays_traced() const;

 private:
  // Counted apart by thread: a shared counter would cost more than it tells.
  struct alignas(64) RayCounter {
    std::atomic<uint64_t> value{0};
  };
  static constexpr size_t kRayCounters = 64;
  void count_ray() const;

  using Tangents = std::shared_ptr<const std::vector<CornerTangent>>;  // of each corner of a mesh's triangles

  void index_vertices(const Scene* before);
  void make_strands(const Scene* before);
  void place_instances();
  void place_meshes(const Editing& editing);
  void displace(const Scene* before, int threads);
  bool is_displaced_as(uint32_t mesh, const Scene& before) const;
  void displace_mesh(uint32_t instance, int threads);
  void retie_tangents(uint32_t mesh, const std::vector<Tangents>* known);
  int displacement_of(uint32_t instance, uint32_t triangle) const;  // the program, or -1
  Vec3 displacement_normal(uint32_t mesh, uint32_t triangle, int k) const;
  Vec3 displacement_at(uint32_t instance, uint32_t triangle, int k, Vec3 normal) const;
  void renew_normals(uint32_t instance, const std::vector<Vec3>& from, const std::vector<Vec3>& to);
  void resolve_attributes();
  void make_tangents(const Scene* before);
  Tangents known_tangents(const MeshData& mesh, int slot, const Scene* before) const;
  std::vector<CornerTangent> tangents_of(uint32_t mesh, int slot) const;
  void build_accel(const std::string& embree, int threads, const Scene* before);
  ShadingPoint strand_point(const Hit& hit, Vec3 position, Vec3 wo, const PathState& path, float footprint) const;
  void set_strand_normals(ShadingPoint& point) const;
  Vec3 vertex(const Instance& instance, uint32_t v) const;
  Vec3 corner_normal(uint32_t mesh, uint32_t triangle, int k) const;
  void interpolate(uint32_t mesh, const AttributeData& attribute, const ShadingPoint& point, float out[4]) const;

  SceneData data_;
  std::vector<Instance> instances_;
  std::vector<std::vector<int32_t>> attribute_index_;  // per mesh and slot: which of its attributes, or -1
  std::vector<std::vector<Tangents>> tangents_;        // per mesh and slot; none where no op takes them
  std::vector<std::vector<Tangents>> undisplaced_tangents_;  // the same before displacement, where there is one
  std::vector<int32_t> moved_by_;                      // per mesh: the instance whose materials displace it, or -1
  std::vector<int32_t> active_uv_;                     // per mesh: which attribute, or -1
  std::vector<Array<const uint32_t>> indices_;         // per mesh: Embree's index buffer
  std::vector<std::shared_ptr<const Strands>> strands_;  // per mesh; null where it is of triangles
  std::vector<Bounds> mesh_bounds_;                    // per mesh, of its positions as they are
  std::unique_ptr<ShaderResources> resources_;
  std::unique_ptr<Accel> accel_;
  mutable std::array<RayCounter, kRayCounters> rays_;
  Bounds bounds_;
  bool any_transparent_ = false;
  // Instances whose materials may let shadow rays through answer to this bit instead of kRayShadow, so that one occlusion query settles
  // all that is opaque.
  static constexpr uint32_t kTransparentShadowBit = 1u << 16;
  static constexpr uint32_t kVolumeBit = 1u << 17;  // what objects that are filled answer to
};

}  // namespace gi
