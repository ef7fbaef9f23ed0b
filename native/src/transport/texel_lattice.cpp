// Building the lattice: which corners and edges are shared, how fine each triangle is, what each node covers.
#include "transport/texel_lattice.h"

#include <algorithm>
#include <bit>
#include <numeric>
#include <unordered_map>

#include "core/sampler.h"

namespace gi {
namespace {

constexpr int kMaxLevel = 11;
constexpr float kSameNormal = 0.9995f;   // cosine: 1.8 degrees
constexpr float kFlat = 0.9995f;         // cosine between faces that go on in one plane
constexpr float kSharpest = 0.2f;  // cosine between faces that smooth shading joins
constexpr float kLongest = 16.0f;  // aspect of a triangle beyond which its small ones become longer than wished
constexpr double kSmall = 0.5;  // of the wished size: triangles below are merged

int level_of(const Vec3 v[3], double size) {
  const float a = length_squared(v[1] - v[0]), b = length_squared(v[2] - v[1]), c = length_squared(v[0] - v[2]);
  const double longest = std::sqrt(double(std::max({a, b, c})));
  const double height = longest > 0 ? double(length(cross(v[1] - v[0], v[2] - v[0]))) / longest : 0;
  const double edge = std::sqrt(longest * std::max(height, longest / kLongest));
  return edge > size ? std::min(kMaxLevel, int(std::lround(std::log2(edge / size)))) : 0;
}

struct Hash {
  size_t operator()(const std::array<uint32_t, 3>& k) const { return hash_combine(hash_combine(k[0], k[1]), k[2]); }
  size_t operator()(const std::array<uint32_t, 2>& k) const { return hash_combine(k[0], k[1]); }
  size_t operator()(const std::array<int, 5>& k) const {
    uint32_t h = 0;
    for (const int x : k) h = hash_combine(h, uint32_t(x));
    return h;
  }
};

// Sets that grow together.
struct UnionFind {
  std::vector<uint32_t> parent;
  explicit UnionFind(size_t n) : parent(n) { std::iota(parent.begin(), parent.end(), 0u); }
  uint32_t find(uint32_t x) {
    while (parent[x] != x) x = parent[x] = parent[parent[x]];
    return x;
  }
  void join(uint32_t a, uint32_t b) {
    a = find(a), b = find(b);
    parent[std::max(a, b)] = std::min(a, b);
  }
};

}  // namespace

struct TexelLattice::Builder {
  struct Face {
    Vec3 v[3], n[3], ng;
    float area, longest;
  };

  TexelLattice& out;
  const double size;
  std::vector<Face> faces;
  UnionFind corners, surfaces;
  uint32_t nodes = 0;

  Builder(TexelLattice& lattice, const Scene& scene, uint32_t instance, double wished)
      : out(lattice),
        size(wished),
        faces(scene.mesh(scene.instances()[instance].mesh).triangle_count()),
        corners(3 * faces.size()),
        surfaces(faces.size()) {
    out.triangles_.resize(faces.size());
    for (uint32_t t = 0; t < faces.size(); ++t) {
      Face& f = faces[t];
      scene.triangle_vertices(instance, t, f.v);
      const Vec3 n = cross(f.v[1] - f.v[0], f.v[2] - f.v[0]);
      f.area = 0.5f * length(n), f.ng = normalize(n);
      f.longest = std::sqrt(std::max({length_squared(f.v[1] - f.v[0]), length_squared(f.v[2] - f.v[1]), length_squared(f.v[0] - f.v[2])}));
      for (int k = 0; k < 3; ++k) f.n[k] = scene.surface_point(instance, t, k == 1, k == 2, f.ng, {}).ns;
      out.triangles_[t].level = uint8_t(level_of(f.v, size));
    }
  }

  // Two triangles along one edge are one surface there if they lie in the same sense and their normals agree at both ends.
  bool smooth(uint32_t t, int a, uint32_t u, int b) const {
    const Face &f = faces[t], &g = faces[u];
    if (!(dot(f.ng, g.ng) > kSharpest)) return false;
    const int a1 = (a + 1) % 3, b1 = (b + 1) % 3;
    if (!(f.v[a] == g.v[b1]) || !(f.v[a1] == g.v[b])) return false;
    return dot(f.n[a], g.n[b1]) > kSameNormal && dot(f.n[a1], g.n[b]) > kSameNormal;
  }

  // Whether triangle u is in the plane of t, and where t's small triangles would be if they went on beyond the edge.
  bool goes_on(uint32_t t, int a, uint32_t u, int b) const {
    const Face &f = faces[t], &g = faces[u];
    if (!(dot(f.ng, g.ng) > kFlat)) return false;
    const Vec3 from = f.v[a], to = f.v[(a + 1) % 3], far = g.v[(b + 2) % 3], middle = from + to - (from + to + f.v[(a + 2) % 3]) / 3.0f;
    return dot(cross(far - from, middle - from), f.ng) > 0.0f && dot(cross(to - far, middle - far), f.ng) > 0.0f;
  }

  // Edges: pairs of smooth neighbours share nodes, as many as the coarser of them has.
  void join_edges() {
    std::unordered_map<std::array<uint32_t, 3>, uint32_t, Hash> place;  // corners in the same place are one
    place.reserve(2 * faces.size());
    std::vector<std::array<uint32_t, 3>> vertex(faces.size());
    for (uint32_t t = 0; t < faces.size(); ++t)
      for (int k = 0; k < 3; ++k) {
        const Vec3 p = faces[t].v[k] + Vec3{0, 0, 0};  // −0 is 0
        const std::array<uint32_t, 3> bits{std::bit_cast<uint32_t>(p.x), std::bit_cast<uint32_t>(p.y), std::bit_cast<uint32_t>(p.z)};
        vertex[t][size_t(k)] = place.try_emplace(bits, uint32_t(place.size())).first->second;
      }
    struct Sides {
      uint32_t side[2];
      int count = 0;
    };
    std::unordered_map<std::array<uint32_t, 2>, Sides, Hash> edges;
    edges.reserve(2 * faces.size());
    for (uint32_t t = 0; t < faces.size(); ++t)
      for (uint32_t k = 0; k < 3; ++k) {
        const uint32_t a = vertex[t][k], b = vertex[t][(k + 1) % 3];
        Sides& s = edges[{std::min(a, b), std::max(a, b)}];
        if (s.count < 2) s.side[s.count] = 3 * t + k;
        ++s.count;
      }
    for (uint32_t t = 0; t < faces.size(); ++t)
      for (uint32_t k = 0; k < 3; ++k) {
        const uint32_t a = vertex[t][k], b = vertex[t][(k + 1) % 3], self = 3 * t + k;
        const Sides& s = edges[{std::min(a, b), std::max(a, b)}];
        const uint32_t other = s.count != 2 ? self : s.side[0] == self ? s.side[1] : s.side[0];
        const uint32_t u = other / 3, m = other % 3;
        Triangle& mine = out.triangles_[t];
        if (u == t || !smooth(t, int(k), u, int(m))) {
          mine.edge_level[k] = mine.level, mine.reversed[k] = false, mine.edge[k] = nodes;
          nodes += (1u << mine.level) - 1;
        } else if (self < other) {
          Triangle& theirs = out.triangles_[u];
          mine.edge_level[k] = theirs.edge_level[m] = std::min(mine.level, theirs.level);
          mine.reversed[k] = false, theirs.reversed[m] = true;
          if (goes_on(t, int(k), u, int(m))) mine.continues |= uint8_t(1u << k);
          if (goes_on(u, int(m), t, int(k))) theirs.continues |= uint8_t(1u << m);
          mine.edge[k] = theirs.edge[m] = nodes;
          nodes += (1u << mine.edge_level[k]) - 1;
          corners.join(3 * t + k, 3 * u + (m + 1) % 3);
          corners.join(3 * t + (k + 1) % 3, 3 * u + m);
          surfaces.join(t, u);
        }
      }
  }

  void number_interiors() {
    for (Triangle& t : out.triangles_) {
      const uint32_t n = 1u << t.level;
      t.interior = nodes, t.cell = out.cells_;
      nodes += n > 2 ? (n - 1) * (n - 2) / 2 : 0;
      out.cells_ += n * n;
    }
  }

  // A vertex between triangles that are all much smaller than wished has no node of its own but shares in those of a grid of the
  // wished size: trilinear in space, and apart by surface and by where its normal points, so that sheets stay apart.
  void number_corners() {
    std::vector<float> longest(corners.parent.size(), 0.0f);
    for (uint32_t c = 0; c < longest.size(); ++c) {
      float& l = longest[corners.find(c)];
      l = std::max(l, faces[c / 3].longest);
    }
    std::vector<uint32_t> id(longest.size(), kNoId);
    std::unordered_map<std::array<int, 5>, uint32_t, Hash> grid;
    out.row_.push_back(0);
    for (uint32_t c = 0; c < id.size(); ++c) {
      const uint32_t root = corners.find(c);
      if (id[root] == kNoId) id[root] = longest[root] < kSmall * size ? merge(c, grid) : nodes++;
      out.triangles_[c / 3].corner[c % 3] = id[root];
    }
  }

  uint32_t merge(uint32_t corner, std::unordered_map<std::array<int, 5>, uint32_t, Hash>& grid) {
    const Face& f = faces[corner / 3];
    const Vec3 p = f.v[corner % 3] * float(1 / size), n = f.n[corner % 3];
    const int surface = int(surfaces.find(corner / 3));
    const Vec3 low{std::floor(p.x), std::floor(p.y), std::floor(p.z)}, s = p - low;
    for (int k = 0; k < 8; ++k) {
      const float w = (k & 1 ? s.x : 1 - s.x) * (k & 2 ? s.y : 1 - s.y) * (k & 4 ? s.z : 1 - s.z);
      for (int axis = 0; axis < 3; ++axis) {
        const float weight = w * n[axis] * n[axis];
        if (!(weight > 0.0f)) continue;
        const std::array<int, 5> key{int(low.x) + (k & 1), int(low.y) + (k >> 1 & 1), int(low.z) + (k >> 2), 2 * axis + (n[axis] < 0),
                                     surface};
        const auto [at, is_new] = grid.try_emplace(key, nodes);
        nodes += is_new;
        out.share_.push_back({at->second, weight});
      }
    }
    out.row_.push_back(uint32_t(out.share_.size()));
    return kMerged + uint32_t(out.row_.size() - 2);
  }

  void measure() {
    std::vector<double> area(nodes, 0.0);
    for (uint32_t t = 0; t < faces.size(); ++t) {
      const int n = 1 << out.triangles_[t].level;
      const double third = double(faces[t].area) / (3.0 * n * n);
      for (int j = 0; j <= n; ++j)
        for (int i = 0; i + j <= n; ++i) {
          const int walls = (i == 0) + (j == 0) + (i + j == n);
          const double covered = third * (walls == 0 ? 6 : walls == 1 ? 3 : 1);
          Corner c[2];
          const int count = out.resolve(t, i, j, n, c);
          for (int k = 0; k < count; ++k)
            out.spread(c[k].id, c[k].weight, [&](uint32_t node, float w) { area[node] += covered * double(w); });
        }
    }
    out.area_.assign(area.begin(), area.end());
  }
};

TexelLattice::TexelLattice(const Scene& scene, uint32_t instance, double size) {
  Builder builder(*this, scene, instance, size);
  builder.join_edges();
  builder.number_interiors();
  builder.number_corners();
  builder.measure();
}

double TexelLattice::estimate_nodes(const Scene& scene, uint32_t instance, double size) {
  double nodes = 0;
  const size_t count = scene.mesh(scene.instances()[instance].mesh).triangle_count();
  for (uint32_t t = 0; t < count; ++t) {
    Vec3 v[3];
    scene.triangle_vertices(instance, t, v);
    const double n = double(1 << level_of(v, size));
    nodes += n > 1 ? 0.5 * (n + 1) * (n + 2) : 0.5;
  }
  return nodes;
}

size_t TexelLattice::memory_bytes() const {
  return triangles_.size() * sizeof(Triangle) + area_.size() * 4 + row_.size() * 4 + share_.size() * sizeof(Share);
}

LatticeCell TexelLattice::locate(uint32_t triangle, float b1, float b2) const {
  const Triangle& t = triangles_[triangle];
  LatticeCell c;
  const int n = 1 << t.level;
  c.triangle = triangle, c.size = n;
  const float x = std::clamp(b1, 0.0f, 1.0f) * float(n), y = std::clamp(b2, 0.0f, 1.0f) * float(n);
  const int j = std::min(int(y), n - 1), i = std::min(int(x), n - 1 - j);
  const float u = std::min(x - float(i), 1.0f), v = std::min(y - float(j), 1.0f);
  const uint32_t row = t.cell + uint32_t(j * (2 * n - j));  // rows of 2 (n − j) − 1 small triangles
  if (u + v <= 1.0f || i + j == n - 1) {
    c.at = {{{i, j}, {i + 1, j}, {i, j + 1}}};
    const float w0 = std::max(1.0f - u - v, 0.0f), sum = w0 + u + v;
    c.weight[0] = w0 / sum, c.weight[1] = u / sum, c.weight[2] = v / sum;
    c.index = row + uint32_t(2 * i);
  } else {
    c.at = {{{i + 1, j + 1}, {i, j + 1}, {i + 1, j}}};
    c.weight[0] = u + v - 1.0f, c.weight[1] = 1.0f - u, c.weight[2] = 1.0f - v;
    c.index = row + uint32_t(2 * i) + 1;
  }
  return c;
}

LatticeCell TexelLattice::cell(uint32_t triangle, uint32_t k) const {
  const int n = 1 << triangles_[triangle].level;
  int j = std::max(0, int(double(n) - std::sqrt(double(n) * n - double(k))) - 1);
  while (j + 1 < n && uint32_t((j + 1) * (2 * n - j - 1)) <= k) ++j;  // rows as in locate()
  const int place = int(k) - j * (2 * n - j), i = place / 2;
  const float third = place % 2 == 0 ? 1.0f / 3.0f : 2.0f / 3.0f;
  return locate(triangle, (float(i) + third) / float(n), (float(j) + third) / float(n));
}

int TexelLattice::resolve(uint32_t triangle, int i, int j, int n, Corner out[2]) const {
  const Triangle& t = triangles_[triangle];
  const int k = n - i - j;
  if (i > 0 && j > 0 && k > 0) {
    out[0] = {t.interior + uint32_t((j - 1) * (n - 1) - (j - 1) * j / 2 + i - 1), 1.0f};
    return 1;
  }
  // Along edge 01 (j = 0), 12 (k = 0) or 20 (i = 0).
  const int e = j == 0 ? 0 : k == 0 ? 1 : 2, place = e == 0 ? i : e == 1 ? j : k;
  const int m = 1 << t.edge_level[e], step = n / m, q = place / step, rest = place % step;
  const auto node = [&](int at) {
    if (at == 0) return t.corner[e];
    if (at == m) return t.corner[(e + 1) % 3];
    return t.edge[e] + uint32_t(t.reversed[e] ? m - at : at) - 1;
  };
  const float part = float(rest) / float(step);
  out[0] = {node(q), 1.0f - part};
  if (rest == 0) return 1;
  out[1] = {node(q + 1), part};
  return 2;
}

void TexelLattice::add_nodes(const LatticeCell& cell, int corner, float weight, float choice, LatticePoint& out) const {
  Corner c[2];
  const int n = resolve(cell.triangle, cell.at[size_t(corner)][0], cell.at[size_t(corner)][1], cell.size, c);
  for (int k = 0; k < n; ++k) {
    if (!(c[k].id & kMerged)) {
      out.add(c[k].id, weight * c[k].weight);
      continue;
    }
    const uint32_t row = c[k].id & ~kMerged, last = row_[row + 1] - 1;
    uint32_t s = row_[row];
    for (float left = choice; s < last && left >= share_[s].weight; ++s) left -= share_[s].weight;
    out.add(share_[s].node, weight * c[k].weight);
  }
}

}  // namespace gi
