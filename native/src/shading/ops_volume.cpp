// Ops that end the node tree of a volume: each adds to state.medium. The first input is the weight that Mix Shader leaves.
// Leaves out grids.
#include "shading/medium.h"
#include "shading/op_helpers.h"
#include "shading/ops.h"

namespace gi {
namespace {

enum Phase { kHenyey, kRayleigh, kDraine, kMie, kFournierForand };  // what immediates mean by them

void scatter(Medium& m, Rgb sigma_s, int phase, float g, float extra) {
  switch (phase) {
    case kHenyey: return m.add_scattering(sigma_s, g, 0.0f);
    case kRayleigh: return m.add_scattering(sigma_s, 0.0f, 1.0f);
    case kDraine: return m.add_scattering(sigma_s, g, extra);
    case kFournierForand: return m.add_scattering(sigma_s, FournierForand(g, extra));
    default: break;
  }
  const MieFit fit = mie_fit(extra);
  m.add_scattering(sigma_s * (1.0f - fit.share_draine), fit.g_henyey, 0.0f);
  m.add_scattering(sigma_s * fit.share_draine, fit.g_draine, fit.alpha);
}

// weight, absorption, scattering and emission coefficients, anisotropy or backscatter, alpha or diameter or index of refraction; phase
void volume_coefficients(const Operands& o, ShadeState& s) {
  if (!s.medium) return;
  const float weight = o.f(0);
  s.medium->add_absorption(o.c(1) * weight);
  scatter(*s.medium, o.c(2) * weight, o.imm(6), o.f(4), o.f(5));
  s.medium->emission += o.c(3) * weight;
}

const Op kOps[] = {
    {"volume_coefficients", "", "fvvvff", 1, OpKind::kClosure, volume_coefficients, kAddsLobe},
};

}  // namespace

std::span<const Op> volume_ops() { return kOps; }

}  // namespace gi
