// MikkTSpace for triangles, so that normal maps look as in Blender and wherever else they are made.
#include "scene/tangents.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <numeric>

namespace gi {
namespace {

constexpr uint32_t kNone = 0xffffffffu;

struct Triangle {
  std::array<uint32_t, 3> vertex;                            // welded
  std::array<uint32_t, 3> neighbour{kNone, kNone, kNone};    // over the edge from corner i to the next
  std::array<uint32_t, 3> group{kNone, kNone, kNone};        // of each corner
  Vec3 tangent;
  bool flat = false;          // two corners in one place: no tangent of its own, and no neighbours
  bool joins_any = true;      // its UVs have no area: it takes the side of whoever asks first
  bool keeps_side = false;    // not mirrored in the UV map
};

// All corners about one vertex that share a tangent.
struct Group {
  uint32_t vertex;
  bool keeps_side;
  Vec3 tangent;
};

bool same(const TangentCorner& a, const TangentCorner& b) {
  return a.position == b.position && a.normal == b.normal && a.uv.x == b.uv.x && a.uv.y == b.uv.y;
}

uint32_t hash_of(const TangentCorner& c) {
  uint32_t h = 0x9e3779b9u;
  for (const float x : {c.position.x, c.position.y, c.position.z, c.normal.x, c.normal.y, c.normal.z, c.uv.x, c.uv.y}) {
    const float unsigned_zero = x + 0.0f;
    uint32_t bits;
    std::memcpy(&bits, &unsigned_zero, sizeof(bits));
    h = (h ^ bits) * 0x01000193u;
    h ^= h >> 15;
  }
  return h;
}

// For every corner the first one that is the same.
std::vector<uint32_t> weld(const std::vector<TangentCorner>& corners) {
  size_t size = 16;
  while (size < corners.size() * 2) size *= 2;
  std::vector<uint32_t> table(size, kNone), first(corners.size());
  for (size_t c = 0; c < corners.size(); ++c) {
    size_t at = hash_of(corners[c]) & (size - 1);
    while (table[at] != kNone && !same(corners[table[at]], corners[c])) at = (at + 1) & (size - 1);
    if (table[at] == kNone) table[at] = uint32_t(c);
    first[c] = table[at];
  }
  return first;
}

class Mesh {
 public:
  explicit Mesh(const std::vector<TangentCorner>& corners) : corners_(corners), triangles_(corners.size() / 3) {
    const std::vector<uint32_t> welded = weld(corners);
    for (size_t t = 0; t < triangles_.size(); ++t) {
      std::copy_n(welded.begin() + ptrdiff_t(3 * t), 3, triangles_[t].vertex.begin());
      measure(triangles_[t]);
    }
    find_neighbours();
    for (uint32_t t = 0; t < triangles_.size(); ++t)
      for (uint32_t i = 0; i < 3; ++i) start_group(t, i);
    for (const Triangle& t : triangles_) add_to_groups(t);
  }

  std::vector<CornerTangent> result() const {
    std::vector<CornerTangent> out(corners_.size());
    std::vector<uint32_t> sound(corners_.size(), kNone);  // by welded vertex: a corner to copy from
    for (size_t t = 0; t < triangles_.size(); ++t) {
      for (size_t i = 0; i < 3 && !triangles_[t].flat; ++i) {
        const uint32_t g = triangles_[t].group[i];
        if (g != kNone) out[3 * t + i] = {normalize_or(groups_[g].tangent, Vec3{}), groups_[g].keeps_side ? 1.0f : -1.0f};
        uint32_t& source = sound[triangles_[t].vertex[i]];
        if (source == kNone) source = uint32_t(3 * t + i);
      }
    }
    for (size_t t = 0; t < triangles_.size(); ++t)
      for (size_t i = 0; i < 3 && triangles_[t].flat; ++i)
        if (const uint32_t source = sound[triangles_[t].vertex[i]]; source != kNone) out[3 * t + i] = out[source];
    return out;
  }

 private:
  const TangentCorner& at(const Triangle& t, size_t i) const { return corners_[t.vertex[i]]; }

  void measure(Triangle& t) const {
    const TangentCorner &a = at(t, 0), &b = at(t, 1), &c = at(t, 2);
    t.flat = a.position == b.position || b.position == c.position || c.position == a.position;
    const Vec3 p1 = b.position - a.position, p2 = c.position - a.position;
    const float u1 = b.uv.x - a.uv.x, v1 = b.uv.y - a.uv.y, u2 = c.uv.x - a.uv.x, v2 = c.uv.y - a.uv.y;
    const float area = u1 * v2 - v1 * u2;
    t.keeps_side = area > 0.0f;
    if (t.flat || !(std::abs(area) > kTiny)) return;
    const Vec3 along_u = v2 * p1 - v1 * p2, along_v = u1 * p2 - u2 * p1;
    if (!(length_squared(along_u) > kTiny)) return;
    t.tangent = along_u * ((t.keeps_side ? 1.0f : -1.0f) / length(along_u));
    t.joins_any = !(length_squared(along_v) > kTiny);
  }

  void find_neighbours() {
    struct Edge {
      uint32_t low, high, corner;
    };
    std::vector<Edge> edges;
    edges.reserve(corners_.size());
    for (uint32_t t = 0; t < triangles_.size(); ++t) {
      for (uint32_t i = 0; i < 3 && !triangles_[t].flat; ++i) {
        const uint32_t from = triangles_[t].vertex[i], to = triangles_[t].vertex[(i + 1) % 3];
        edges.push_back({std::min(from, to), std::max(from, to), 3 * t + i});
      }
    }
    std::sort(edges.begin(), edges.end(), [](const Edge& a, const Edge& b) {
      return a.low != b.low ? a.low < b.low : a.high != b.high ? a.high < b.high : a.corner < b.corner;
    });
    // Two triangles meet over an edge that they run along in opposite directions.
    for (size_t a = 0; a < edges.size(); ++a) {
      uint32_t& mine = triangles_[edges[a].corner / 3].neighbour[edges[a].corner % 3];
      for (size_t b = a + 1; mine == kNone && b < edges.size() && edges[b].low == edges[a].low && edges[b].high == edges[a].high; ++b) {
        uint32_t& other = triangles_[edges[b].corner / 3].neighbour[edges[b].corner % 3];
        const bool opposite = start_of(edges[a].corner) != start_of(edges[b].corner);
        if (other == kNone && opposite) mine = edges[b].corner / 3, other = edges[a].corner / 3;
      }
    }
  }
  uint32_t start_of(uint32_t corner) const { return triangles_[corner / 3].vertex[corner % 3]; }

  void start_group(uint32_t first, uint32_t corner) {
    const Triangle& seed = triangles_[first];
    if (seed.flat || seed.joins_any || seed.group[corner] != kNone) return;
    const auto id = uint32_t(groups_.size());
    groups_.push_back({seed.vertex[corner], seed.keeps_side, Vec3{}});
    const Group group = groups_.back();
    std::vector<uint32_t> waiting{first};
    while (!waiting.empty()) {
      Triangle& t = triangles_[waiting.back()];
      waiting.pop_back();
      const auto i = size_t(std::find(t.vertex.begin(), t.vertex.end(), group.vertex) - t.vertex.begin());
      if (t.group[i] != kNone) continue;
      const bool free = t.joins_any && t.group == std::array<uint32_t, 3>{kNone, kNone, kNone};
      if (free) t.keeps_side = group.keeps_side;
      if (t.keeps_side != group.keeps_side) continue;
      t.group[i] = id;
      for (const uint32_t next : {t.neighbour[(i + 2) % 3], t.neighbour[i]})
        if (next != kNone) waiting.push_back(next);
    }
  }

  // Weighed by the angle at the corner, both seen along the normal there.
  void add_to_groups(const Triangle& t) {
    if (t.flat || t.joins_any) return;
    for (size_t i = 0; i < 3; ++i) {
      if (t.group[i] == kNone) continue;
      const Vec3 n = at(t, i).normal, p = at(t, i).position;
      const auto in_plane = [&](Vec3 v) { return normalize_or(v - n * dot(n, v), Vec3{}); };
      const float cosine = dot(in_plane(at(t, (i + 1) % 3).position - p), in_plane(at(t, (i + 2) % 3).position - p));
      groups_[t.group[i]].tangent += in_plane(t.tangent) * std::acos(std::clamp(cosine, -1.0f, 1.0f));
    }
  }

  static constexpr float kTiny = 1.17549435e-38f;  // the smallest normal number
  const std::vector<TangentCorner>& corners_;
  std::vector<Triangle> triangles_;
  std::vector<Group> groups_;
};

}  // namespace

std::vector<CornerTangent> corner_tangents(const std::vector<TangentCorner>& corners) { return Mesh(corners).result(); }

Vec2 spherical_uv(Vec3 p) {
  const float r = length(p);
  if (!(r > 0.0f)) return {0, 0};
  const float u = p.x == 0.0f && p.y == 0.0f ? 0.0f : 0.5f - std::atan2(p.x, p.y) / (2.0f * kPi);
  return {u, 1.0f - std::acos(std::clamp(p.z / r, -1.0f, 1.0f)) * kInvPi};
}

}  // namespace gi
