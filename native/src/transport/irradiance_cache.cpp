// IrradianceCache: a record is referred to by every node that its sphere reaches, at the depth that fits its size, so that a lookup is
// one way down the tree.
#include "transport/irradiance_cache.h"

namespace gi {
namespace {

constexpr float kNodeSize = 4.0f;      // times a record's reach: nodes down to this side are divided for it
constexpr float kEven = 0.5f;         // times α: records nearer than this count alike, so that none shows as a dot
constexpr float kCovered = 0.8f;      // of a record's reach
constexpr float kLeastCosine = 0.5f;   // between normals
constexpr float kInFront = 0.02f;      // of the radius: tolerance of the test for records in front of the point
constexpr float kOppositeSide = -0.2f; // cosine of normals of which one does not clamp the other

// Squared distance of a point from a cube.
float distance_squared(Vec3 p, Vec3 low, float side) {
  const Vec3 nearest = min(max(p, low), low + Vec3{side, side, side});
  return length_squared(p - nearest);
}

bool are_neighbours(const IrradianceRecord& a, const IrradianceRecord& b) { return dot(a.normal, b.normal) > kOppositeSide; }

// The radius that `record` may have beside `other`.
float clamped(const IrradianceRecord& record, const IrradianceRecord& other) {
  const float most = other.radius + length(other.position - record.position);
  return std::min(record.radius, std::max(record.least, most));
}

}  // namespace

// A cursor over a row: each call writes or reads what comes next.
void IrradianceRecord::write(float* row) const {
  const auto put = [&](const auto& v) {
    for (int k = 0; k < 3; ++k) *row++ = v[k];
  };
  put(position), put(normal);
  *row++ = radius, *row++ = least, *row++ = reach;
  put(irradiance);
  for (const Rgb& c : translation) put(c);
  for (const Rgb& c : lateral) put(c);
}

IrradianceRecord IrradianceRecord::read(const float* row) {
  IrradianceRecord r;
  const auto get = [&](auto& v) {
    for (int k = 0; k < 3; ++k) v[k] = *row++;
  };
  get(r.position), get(r.normal);
  r.radius = *row++, r.least = *row++, r.reach = *row++;
  get(r.irradiance);
  for (Rgb& c : r.translation) get(c);
  for (Rgb& c : r.lateral) get(c);
  return r;
}

IrradianceCache::IrradianceCache(Bounds bounds, float error) : error_(error) {
  const Vec3 extent = bounds.empty() ? Vec3{1, 1, 1} : bounds.extent();
  side_ = 1.01f * std::max({extent.x, extent.y, extent.z, 1e-3f});
  low_ = (bounds.empty() ? Vec3{} : bounds.center()) - Vec3{side_, side_, side_} * 0.5f;
}

uint32_t IrradianceCache::child_towards(Vec3 p, Vec3& low, float& side, const Node& node) const {
  side *= 0.5f;
  int i = 0;
  if (p.x >= low.x + side) i |= 1, low.x += side;
  if (p.y >= low.y + side) i |= 2, low.y += side;
  if (p.z >= low.z + side) i |= 4, low.z += side;
  return node.child[i];
}

// Calls f(hot) for every record that might hold at `position`.
template <class F>
void IrradianceCache::for_each_at(Vec3 position, const F& f) const {
  Vec3 low = low_;
  float side = side_;
  uint32_t index = 0;
  do {
    const Node& node = nodes_[index];
    if (is_frozen_) {
      for (uint32_t b = node.begin; b < node.end; ++b) {
        const Block& block = blocks_[b];
        float beyond[Block::kSize];
        for (uint32_t i = 0; i < Block::kSize; ++i)
          beyond[i] = sqr(block.x[i] - position.x) + sqr(block.y[i] - position.y) + sqr(block.z[i] - position.z) - block.reach_squared[i];
        for (uint32_t i = 0; i < Block::kSize; ++i)
          if (beyond[i] < 0.0f) f(hot_of(block.record[i]));
      }
    } else {
      for (uint32_t i = node.first; i != kNone; i = links_[i].next) f(hot_[links_[i].record]);
    }
    index = child_towards(position, low, side, node);
  } while (index);
}

// Calls f(record) for every record that reaches into the sphere, some several times.
template <class F>
void IrradianceCache::for_each_within(uint32_t index, Vec3 low, float side, Vec3 centre, float radius, const F& f) const {
  if (distance_squared(centre, low, side) > sqr(radius)) return;
  for (uint32_t i = nodes_[index].first; i != kNone; i = links_[i].next) f(links_[i].record);
  const float half = 0.5f * side;
  for (int k = 0; k < 8; ++k) {
    const Vec3 corner = low + Vec3{k & 1 ? half : 0.0f, k & 2 ? half : 0.0f, k & 4 ? half : 0.0f};
    if (const uint32_t child = nodes_[index].child[k]) for_each_within(child, corner, half, centre, radius, f);
  }
}

// The split-sphere estimate of a record's error at a point [Ward 1988, eq. 3]; none where it must not be used: further away than `most`
// allows, on a surface turned elsewhere, or in front of the point.
std::optional<float> IrradianceCache::error_of(const Hot& hot, float radius, Vec3 position, Vec3 normal, float most) {
  const Vec3 d = position - hot.position;
  const float distance2 = dot(d, d);
  if (distance2 >= sqr(most * radius)) return {};
  const float cosine = dot(normal, hot.normal);
  if (cosine < kLeastCosine || dot(d, normal + hot.normal) < -kInFront * radius) return {};
  return std::sqrt(distance2) / radius + safe_sqrt(1.0f - cosine);
}

// [Ward & Heckbert 1992, eq. 4], less a constant so that a record's weight ends at 0 where it does not hold any more.
float IrradianceCache::weight_of(float error) const { return 1.0f / std::max(error, kEven * error_) - 1.0f / (kOverlap * error_); }

bool IrradianceCache::covers(Vec3 position, Vec3 normal, float most, float slack) const {
  bool covered = false;
  const float most_error = slack * error_;
  for_each_at(position, [&](const Hot& hot) {
    const auto error = error_of(hot, std::min(hot.cover, most), position, normal, most_error);
    covered = covered || (error && *error < most_error);
  });
  return covered;
}

std::optional<CachedIrradiance> IrradianceCache::find(Vec3 position, Vec3 normal, Vec3 bumped) const {
  struct Sum {
    Rgb irradiance;
    float weight = 0;
  };
  CachedIrradiance found;
  Sum good, bent;
  const float most = kOverlap * error_, turned = dot(normal, bumped);
  for_each_at(position, [&](const Hot& hot) {
    const auto error = error_of(hot, hot.radius, position, normal, most);
    if (!error || (*error >= most && good.weight > 0.0f)) return;
    const IrradianceRecord& r = records_[hot.record];
    const bool is_good = *error < most;
    const float weight = is_good ? weight_of(*error) : 1.0f / sqr(*error);
    Sum& sum = is_good ? good : bent;
    sum.irradiance += r.at(position, bumped, turned) * weight;
    sum.weight += weight;
    found.nearest = std::min(found.nearest, length(position - r.position));
    ++found.records;
  });
  const Sum& sum = good.weight > 0.0f ? good : bent;
  if (!(sum.weight > 0.0f)) return {};
  found.irradiance = sum.irradiance / sum.weight;
  return found;
}

// A large radius beside a small one has missed what the small one saw: neither may exceed the other by more than their distance.
// [Křivánek 2006] Here for the record itself,
void IrradianceCache::clamp_by_neighbours(IrradianceRecord& record) const {
  for_each_within(0, low_, side_, record.position, kOverlap * error_ * record.radius, [&](uint32_t i) {
    if (are_neighbours(record, records_[i])) record.radius = clamped(record, records_[i]);
  });
}

// and for those beside it, and so on.
void IrradianceCache::clamp_neighbours(uint32_t first) {
  std::vector<uint32_t> shrunk{first};
  while (!shrunk.empty()) {
    const IrradianceRecord& record = records_[shrunk.back()];
    shrunk.pop_back();
    for_each_within(0, low_, side_, record.position, kOverlap * error_ * record.radius, [&](uint32_t i) {
      IrradianceRecord& other = records_[i];
      if (!are_neighbours(record, other)) return;
      const float radius = clamped(other, record);
      if (radius < 0.999f * other.radius) shrunk.push_back(i);
      other.radius = radius;
      hot_[i] = hot_of(i);
    });
  }
}

IrradianceCache::Hot IrradianceCache::hot_of(uint32_t index) const {
  const IrradianceRecord& r = records_[index];
  return {r.position, std::min(r.radius, r.reach / (kOverlap * error_)), r.normal, index, std::min(r.radius, kCovered * r.reach / error_)};
}

void IrradianceCache::insert(IrradianceRecord record) {
  is_frozen_ = false;
  clamp_by_neighbours(record);
  const uint32_t index = uint32_t(records_.size());
  records_.push_back(record);
  hot_.push_back(hot_of(index));
  refer(0, low_, side_, index, kOverlap * error_ * record.radius);
  clamp_neighbours(index);
}

void IrradianceCache::refer(uint32_t index, Vec3 low, float side, uint32_t record, float reach) {
  const float half = 0.5f * side;
  if (side < kNodeSize * reach || side < 1e-6f * side_) {
    links_.push_back({record, nodes_[index].first});
    nodes_[index].first = uint32_t(links_.size()) - 1;
    return;
  }
  for (int k = 0; k < 8; ++k) {
    const Vec3 corner = low + Vec3{k & 1 ? half : 0.0f, k & 2 ? half : 0.0f, k & 4 ? half : 0.0f};
    if (distance_squared(records_[record].position, corner, half) > sqr(reach)) continue;
    if (!nodes_[index].child[k]) {
      nodes_[index].child[k] = uint32_t(nodes_.size());
      nodes_.emplace_back();
    }
    refer(nodes_[index].child[k], corner, half, record, reach);
  }
}

void IrradianceCache::freeze() {
  if (is_frozen_) return;
  // Radii have shrunk since the first records went in: a new tree refers to each from fewer nodes.
  nodes_.assign(1, Node());
  links_.clear();
  for (uint32_t i = 0; i < records_.size(); ++i) refer(0, low_, side_, i, kOverlap * error_ * records_[i].radius);
  blocks_.clear();
  for (Node& node : nodes_) {
    node.begin = uint32_t(blocks_.size());
    uint32_t k = 0;
    for (uint32_t i = node.first; i != kNone; i = links_[i].next, k = (k + 1) % Block::kSize) {
      if (k == 0) blocks_.emplace_back();
      const Hot hot = hot_of(links_[i].record);
      Block& block = blocks_.back();
      block.x[k] = hot.position.x, block.y[k] = hot.position.y, block.z[k] = hot.position.z, block.record[k] = hot.record;
      block.reach_squared[k] = sqr(kOverlap * error_ * std::max(hot.radius, hot.cover));
    }
    node.end = uint32_t(blocks_.size());
  }
  is_frozen_ = true;
}

size_t IrradianceCache::memory_bytes() const {
  return records_.capacity() * sizeof(IrradianceRecord) + nodes_.capacity() * sizeof(Node) + links_.capacity() * sizeof(Link) +
         hot_.capacity() * sizeof(Hot) + blocks_.capacity() * sizeof(Block);
}

}  // namespace gi
