// Ops of the two hair nodes: absorption from colours and from pigments, and their lobes. Where fibres lie is strand's to say (scene/).
#include "shading/closures.h"
#include "shading/ops.h"

namespace gi {
namespace {

constexpr float kMostAbsorption = 1e8f;  // of black

// value, random, amount: up to half the amount less or more.
float varied(float value, float random, float amount) { return value * (1.0f + 2.0f * (random - 0.5f) * amount); }
void vary(const Operands& o, ShadeState&) { o.set(0, varied(o.f(1), o.f(2), o.f(3))); }

// The absorption by which many fibres together have a colour. [Chiang et al. 2016, eq. 9]
void absorption_of_color(const Operands& o, ShadeState&) {
  const Rgb color = positive(o.c(1));
  const float depth = HairChiang::absorption_depth(o.f(2));
  Rgb sigma;
  for (int i = 0; i < 3; ++i) sigma[i] = std::min(sqr(std::log(color[i]) / depth), kMostAbsorption);
  o.set(0, sigma);
}

// melanin, redness. [d'Eon et al. 2011, §6.1, for the two pigments]
void absorption_of_melanin(const Operands& o, ShadeState&) {
  const float amount = -std::log(std::max(1.0f - o.f(1), 1e-4f));
  o.set(0, Rgb(0.506f, 0.841f, 1.653f) * (amount * (1.0f - o.f(2))) + Rgb(0.343f, 0.733f, 1.924f) * (amount * o.f(2)));
}

// On meshes a lobe's own normal is far from the surface's. As in Cycles, directions that are on the surface's one side and the lobe's other
// are then left out where light is looked for; not so up to Blender 4.5.
template <class L>
void add_fibre(ShadeState& s, Rgb weight, const L& lobe, Vec3 n, Vec3 tangent, bool leaves_out) {
  const int before = s.bsdf->lobe_count();
  add_lobe(s, weight, lobe, n, tangent);
  if (!leaves_out && s.bsdf->lobe_count() > before) s.bsdf->forget_last_bump();
}

// weight, color, roughness along and around, offset, tangent; along and across the surface, whether it is a strand; side
void hair_strand(const Operands& o, ShadeState& s) {
  if (!s.bsdf) return;
  const bool linked = !(o.v(5) == Vec3{}), strand = o.f(8) != 0.0f;
  const Vec3 tangent = normalize_or(linked ? o.v(5) : strand ? o.v(6) : o.v(7), Vec3{});
  if (tangent == Vec3{}) return;
  const Vec3 n = strand ? s.point.ns : visible_normal(s, s.point.ns);
  const float offset = linked || strand ? -o.f(4) : 0.0f;
  add_lobe(s, o.c(1) * o.f(0), HairStrand::make(Frame::from_normal(n).to_local(tangent), o.f(2), o.f(3), offset, o.imm(9) != 0), n);
}

// weight, absorption, roughness, radial roughness, coat, offset, ior; along the fibre, where it is met; as add_fibre
void hair_chiang(const Operands& o, ShadeState& s) {
  if (!s.bsdf) return;
  const Vec3 x = normalize_or(o.v(7), Vec3{}), y = normalize_or(cross(x, s.point.wo), Vec3{});
  if (y == Vec3{}) return;
  const float met = o.f(8), h = std::abs(met) <= 1.0f ? met : dot(cross(s.point.ng, x), cross(x, y));
  const HairChiang lobe = HairChiang::make(positive(o.c(1)), o.f(2), o.f(3), o.f(4), o.f(5), std::max(o.f(6), 1e-3f), h);
  add_fibre(s, Rgb(o.f(0)), lobe, y, x, o.imm(9) != 0);
}

// weight, absorption, roughness, offset, ior, aspect, R, TT, TRT; along the fibre, where a ribbon is met, whether it is a strand, its
// diameter (metres); its own normal, along which the long axis lies, taken for the world's as in Cycles; as add_fibre. Rays that pass an
// elliptic fibre, which is traced as a round one, go on. Where the camera sees the fibre wider than a pixel, it sees a part of the width
// alone, half as wide as the pixel: of equal parts, so that none counts more than another; about where a ray meets the fibre, edges would
// count less.
void hair_huang(const Operands& o, ShadeState& s) {
  if (!s.bsdf || (o.f(6) <= 0.0f && o.f(7) <= 0.0f && o.f(8) <= 0.0f)) return;
  const Vec3 y = normalize(o.v(9)), across = normalize(cross(y, s.point.wo));
  if (across == Vec3{}) return;
  const bool strand = o.f(11) != 0.0f, elliptic = strand && o.f(5) != 1.0f;
  const float aspect = std::max(elliptic && o.f(5) > 1.0f ? 1.0f / o.f(5) : o.f(5), 1e-3f);
  const Vec3 own = normalize(cross(y, cross(o.v(13), y))), x = elliptic ? normalize_or(own, Frame::from_normal(y).x) : across;
  HairHuang lobe = HairHuang::make({positive(o.c(1)), o.f(2), o.f(3), std::max(o.f(4), 1e-3f), aspect, o.f(6), o.f(7), o.f(8)});
  const float h = std::abs(o.f(10)) <= 1.0f ? o.f(10) : -dot(across, s.point.ns);
  const float wide = lobe.projected_radius(Frame::from_normal_and_tangent(x, y).to_local(s.point.wo));
  if (elliptic && std::abs(h) >= wide) {
    s.bsdf->transparency += Rgb(o.f(0));
    return;
  }
  const float pixel = s.point.footprint / (0.5f * o.f(12));  // over the fibre's radius
  if (strand && (s.point.path.kind & kRayCamera) && pixel > 0.0f && wide > pixel) {
    const float parts = std::ceil(2.0f * wide / pixel), part = 2.0f * wide / parts;
    lobe.h_from = part * std::clamp(std::floor((h + wide) / part), 0.0f, parts - 1.0f) - wide, lobe.h_to = lobe.h_from + part;
  }
  add_fibre(s, Rgb(o.f(0)), lobe, x, y, o.imm(14) != 0);
}

const Op kOps[] = {
    {"vary", "f", "fff", 0, OpKind::kPure, vary},
    {"absorption_of_color", "v", "vf", 0, OpKind::kPure, absorption_of_color},
    {"absorption_of_melanin", "v", "ff", 0, OpKind::kPure, absorption_of_melanin},
    {"hair_strand", "", "fvfffvvvf", 1, OpKind::kClosure, hair_strand, kAddsLobe},
    {"hair_chiang", "", "fvfffffvf", 1, OpKind::kClosure, hair_chiang, kAddsLobe},
    {"hair_huang", "", "fvfffffffvfffv", 1, OpKind::kClosure, hair_huang, kAddsLobe},
    {"hair_huang_elliptic", "", "fvfffffffvfffv", 1, OpKind::kClosure, hair_huang, kAddsLobe | kAddsTransparency | kSeesPoint},
};

}  // namespace

std::span<const Op> hair_ops() { return kOps; }

}  // namespace gi
