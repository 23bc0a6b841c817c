#include "hal/sim/scene/sensor.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>

#include "hal/sim/scene/packing.h"
#include "hal/sim/scene/random.h"
#include "hal/sim/scene/response.h"

namespace nodal::hal::sim {

namespace {

constexpr int kBlock = 16;  ///< side in px of the blocks that are tested for movers
/// Indexed by the square root of light: even for a steep response one entry is at most 0.02 levels.
constexpr int kCurveEntries = 1 << 14;
constexpr std::size_t kDeviates = 1 << 16;
constexpr std::size_t kVersions = 4;  ///< versions of the static part with different noise; without noise there is one
constexpr std::uint32_t kBuildEvery = 8;  ///< frames between building further versions, to spread the cost over frames
constexpr int kMaxLevel = 255 << kLevelBits;

bool noisy(const NoiseModel& n) { return n.levels > 0 || n.full_well_electrons > 0; }

std::uint64_t mixed(std::uint64_t a, std::uint64_t b) {
  std::uint64_t z = a + 0x9E3779B97F4A7C15ULL * (b + 1);
  z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9ULL;
  z = (z ^ (z >> 27)) * 0x94D049BB133111EBULL;
  return z ^ (z >> 31);
}

std::vector<float> normal_deviates(std::uint64_t seed, std::size_t count) {
  Random random(seed, "noise");
  std::vector<float> deviates;
  deviates.reserve(count);
  while (deviates.size() < count) {  // Box and Muller
    const double u = (static_cast<double>(random.next() >> 11) + 0.5) * 0x1p-53;
    const double v = static_cast<double>(random.next() >> 11) * 0x1p-53;
    const double radius = std::sqrt(-2 * std::log(u));
    deviates.push_back(static_cast<float>(radius * std::cos(2 * std::numbers::pi * v)));
    deviates.push_back(static_cast<float>(radius * std::sin(2 * std::numbers::pi * v)));
  }
  return deviates;
}

std::vector<PlacedMover> placed(std::span<const Mover> movers, Instant at) {
  std::vector<PlacedMover> all;
  all.reserve(movers.size());
  for (const Mover& mover : movers) all.emplace_back(mover, at);
  return all;
}

double angle_between(const Direction& a, const Direction& b) {
  return std::acos(std::clamp(a.x * b.x + a.y * b.y + a.z * b.z, -1.0, 1.0));
}

}  // namespace

Sensor::Sensor(const HeadCalibration& truth, const SensorOptions& options, ScenePtr scene, std::uint64_t seed)
    : truth_(truth), options_(options), scene_(std::move(scene)), seed_(seed), lens_(truth) {
  NODAL_ASSERT(options_.supersampling >= 1);
  NODAL_ASSERT(options_.pixels != PixelFormat::kMjpeg);
  NODAL_ASSERT(!options_.interlaced || truth.height % 4 == 0);
}

void Sensor::prepare() {
  if (prepared_) return;
  prepared_ = true;
  plate_ = expose_plate(truth_, lens_, *scene_, options_.supersampling);
  make_curve({});
  const auto width = static_cast<std::size_t>(truth_.width);
  if (noisy(options_.noise)) normal_ = normal_deviates(seed_, kDeviates + width);
  versions_.resize(noisy(options_.noise) ? kVersions : 1);
  light_row_.resize(3 * width);
  rows_.resize(6 * width);
  for (int y = 0; y < truth_.height && !scene_->movers().empty(); y += kBlock) {
    for (int x = 0; x < truth_.width; x += kBlock) {
      std::vector<Direction> rays;
      Direction sum{0, 0, 0};
      for (int k = 0; k < 25; ++k) {
        const auto ray = lens_.ray(x + (k % 5) * kBlock / 4.0, y + (k / 5) * kBlock / 4.0);
        if (!ray) continue;
        rays.push_back(*ray);
        sum = {sum.x + ray->x, sum.y + ray->y, sum.z + ray->z};
      }
      const double length = std::sqrt(sum.x * sum.x + sum.y * sum.y + sum.z * sum.z);
      Block block{{sum.x / length, sum.y / length, sum.z / length}, !rays.empty()};
      double radius = 0;
      for (const Direction& ray : rays) radius = std::max(radius, 1.1 * angle_between(block.middle, ray));
      block.cosine = std::cos(radius);
      block.sine = std::sin(radius);
      blocks_.push_back(block);
    }
  }
}

void Sensor::make_curve(Gamma gamma) {
  curve_is_of_ = gamma;
  Response response = truth_.response;
  if (gamma != Gamma()) {
    response = {};
    response.curve = Response::Curve::kGamma;
    response.gamma = gamma.thousandths() / 1000.0;
  }
  encoded_.resize(kCurveEntries);
  for (int i = 0; i < kCurveEntries; ++i) {
    const double root = static_cast<double>(i) / (kCurveEntries - 1);
    encoded_[static_cast<std::size_t>(i)] =
        static_cast<std::uint16_t>(std::lround(encode(response, root * root) * kMaxLevel));
  }
}

void Sensor::set_light(double factor) {
  if (factor == light_) return;
  light_ = factor;
  settings_.reset();  // everything is developed again
}

void Sensor::use(const HeadSettings& settings) {
  if (settings_ == settings) return;
  if (curve_is_of_ != settings.gamma) make_curve(settings.gamma);
  settings_ = settings;
  versions_ready_ = 0;
  still_id_ += kVersions;
  if (still_id_ == kVersions) still_id_ = 1;
  const double exposure =
      static_cast<double>(settings.exposure.duration().ns()) / static_cast<double>(options_.reference.duration().ns());
  const double gain = std::pow(10.0, settings.gain.mdb() / 20'000.0);
  const std::array<double, 3> balance{settings.white_balance.red_q12 / 4096.0, 1.0,
                                      settings.white_balance.blue_q12 / 4096.0};
  // Light that corresponds to one electron.
  const double electron = options_.noise.full_well_electrons > 0 ? gain / options_.noise.full_well_electrons : 0;
  for (std::size_t c = 0; c < 3; ++c) {
    curve_.scale[c] = static_cast<float>(light_ * exposure * gain * balance[c]);
    curve_.shot[c] = static_cast<float>(electron * balance[c]);
    const double read = options_.noise.read_electrons * electron * balance[c];
    curve_.read[c] = static_cast<float>(read * read);
  }
  curve_.levels = static_cast<float>(options_.noise.levels * (1 << kLevelBits));
}

std::uint64_t Sensor::render(const HeadSettings& settings, Instant mid_exposure, std::uint32_t number,
                             std::span<std::uint8_t> into, std::uint64_t holds, Fields fields) {
  NODAL_ASSERT(into.size() == packed_size(options_.pixels, truth_.width, truth_.height));
  prepare();
  use(settings);
  const bool build = versions_ready_ == 0 || (versions_ready_ < versions_.size() && last_number_ != number &&
                                              (number + seed_) % kBuildEvery == 0);
  last_number_ = number;
  if (build) {
    std::vector<std::uint8_t>& bytes = versions_[versions_ready_];
    bytes.resize(into.size());
    develop({0, 0, truth_.width, truth_.height}, static_cast<std::uint32_t>(versions_ready_), {}, {},
            packed_image(options_.pixels, truth_.width, truth_.height, bytes.data()));
    ++versions_ready_;
  }
  const std::size_t version = mixed(seed_, number) % versions_ready_;
  std::vector<PlacedMover> top = placed(scene_->movers(), mid_exposure);
  std::vector<PlacedMover> bottom =
      options_.interlaced ? placed(scene_->movers(), mid_exposure + options_.half_period) : top;
  if (fields == Fields::kBottomFirst) std::swap(top, bottom);
  const bool moved = any_touches(top, bottom);
  const std::uint64_t id = moved ? 0 : still_id_ + version;
  if (!moved && id == holds) return id;
  std::copy(versions_[version].begin(), versions_[version].end(), into.begin());
  if (moved) draw_touched(top, bottom, number, packed_image(options_.pixels, truth_.width, truth_.height, into.data()));
  return id;
}

bool Sensor::any_touches(const Movers& top, const Movers& bottom) const {
  for (const Movers* movers : {&top, &bottom}) {
    for (const Block& block : blocks_) {
      for (const PlacedMover& mover : *movers) {
        if (block.sees && mover.may_touch(block.middle, block.cosine, block.sine)) return true;
      }
    }
  }
  return false;
}

void Sensor::draw_touched(const Movers& top, const Movers& bottom, std::uint32_t number, const MutableImageView& into) {
  const int across = (truth_.width + kBlock - 1) / kBlock;
  Movers top_here, bottom_here;
  for (std::size_t b = 0; b < blocks_.size(); ++b) {
    const Block& block = blocks_[b];
    if (!block.sees) continue;
    const auto touches = [&block](const PlacedMover& mover) {
      return mover.may_touch(block.middle, block.cosine, block.sine);
    };
    top_here.clear();
    bottom_here.clear();
    std::copy_if(top.begin(), top.end(), std::back_inserter(top_here), touches);
    std::copy_if(bottom.begin(), bottom.end(), std::back_inserter(bottom_here), touches);
    if (top_here.empty() && bottom_here.empty()) continue;
    const int x = static_cast<int>(b) % across * kBlock;
    const int y = static_cast<int>(b) / across * kBlock;
    develop({x, y, std::min(x + kBlock, truth_.width), std::min(y + kBlock, truth_.height)}, number, top_here,
            bottom_here, into);
  }
}

void Sensor::develop(const Rect& rect, std::uint32_t version, std::span<const PlacedMover> top,
                     std::span<const PlacedMover> bottom, const MutableImageView& into) {
  RowPair pair;
  pair.x0 = std::max(0, rect.x0 - 1);
  pair.x1 = std::min(truth_.width, rect.x1 + 1);
  if (!options_.interlaced) {
    for (int y = rect.y0; y < rect.y1; y += 2) {
      develop_pair(y, 1, pair.x0, pair.x1, version, top, pair);
      pack_rows(pair, y, rect.x0, rect.x1, into);
    }
    return;
  }
  // Rows that share chroma must be of the same field.
  for (const FieldParity parity : {FieldParity::kTop, FieldParity::kBottom}) {
    const bool odd = parity == FieldParity::kBottom;
    const MutableImageView field = field_of(into, parity);
    for (int y = rect.y0; y < rect.y1; y += 4) {
      develop_pair(y + (odd ? 1 : 0), 2, pair.x0, pair.x1, version, odd ? bottom : top, pair);
      pack_rows(pair, y / 2, rect.x0, rect.x1, field);
    }
  }
}

/// Rows y and y + step, if they are in the picture.
void Sensor::develop_pair(int y, int step, int x0, int x1, std::uint32_t version, std::span<const PlacedMover> movers,
                          RowPair& pair) {
  const auto width = static_cast<std::size_t>(truth_.width);
  for (std::size_t r = 0; r < 2; ++r) {
    const int row = y + static_cast<int>(r) * step;
    if (row >= truth_.height) return;
    std::int16_t* const base = rows_.data() + 3 * width * r;
    const std::array<std::int16_t*, 3> out{base, base + width, base + 2 * width};
    develop_row(row, x0, x1, version, movers, out);
    pair.row[r] = {out[0], out[1], out[2]};
  }
}

void Sensor::paint_movers(int y, int x0, std::size_t count, std::span<const PlacedMover> movers) {
  const auto width = static_cast<std::size_t>(truth_.width);
  const double v = y + 0.5;
  for (std::size_t i = 0; i < count; ++i) {
    const double u = x0 + static_cast<double>(i) + 0.5;
    const auto ray = lens_.ray(u, v);
    if (!ray) continue;
    for (const PlacedMover& mover : movers) {
      const auto cover = mover.cover(*ray, lens_.footprint(u, v));
      if (cover.share <= 0) continue;
      const auto left = falloff(truth_, u, v);
      const std::array<float, 3> light{cover.light.r * left[0], cover.light.g * left[1], cover.light.b * left[2]};
      for (std::size_t c = 0; c < 3; ++c) {
        float& under = light_row_[c * width + i];
        under += cover.share * (light[c] - under);
      }
    }
  }
}

void Sensor::develop_row(int y, int x0, int x1, std::uint32_t version, std::span<const PlacedMover> movers,
                         std::array<std::int16_t*, 3> out) {
  const auto width = static_cast<std::size_t>(truth_.width);
  const auto count = static_cast<std::size_t>(x1 - x0);
  const std::size_t start = static_cast<std::size_t>(y) * width + static_cast<std::size_t>(x0);
  for (std::size_t c = 0; c < 3; ++c) {
    std::copy_n(plate_.light[c].data() + start, count, light_row_.data() + c * width);
  }
  if (!movers.empty()) paint_movers(y, x0, count, movers);
  const bool shot = options_.noise.full_well_electrons > 0;
  for (std::size_t c = 0; c < 3; ++c) {
    const std::uint64_t draw = mixed(mixed(seed_, version), static_cast<std::uint64_t>(y) * 3 + c);
    // Deviates are chosen by column, so that a row drawn in parts has the same noise as a row drawn at once.
    const std::size_t first = draw % kDeviates + static_cast<std::size_t>(x0);
    const std::size_t second = (draw >> 32) % kDeviates + static_cast<std::size_t>(x0);
    float* const light = light_row_.data() + c * width;
    const float scale = curve_.scale[c];
    for (std::size_t i = 0; i < count; ++i) light[i] = std::min(light[i] * scale, 1.0F);
    if (shot) {
      for (std::size_t i = 0; i < count; ++i) {
        const float sigma = std::sqrt(light[i] * curve_.shot[c] + curve_.read[c]);
        light[i] = std::clamp(light[i] + sigma * normal_[first + i], 0.0F, 1.0F);
      }
    }
    std::int16_t* const to = out[c];
    for (std::size_t i = 0; i < count; ++i) {
      to[i] = static_cast<std::int16_t>(std::sqrt(light[i]) * (kCurveEntries - 1) + 0.5F);
    }
    for (std::size_t i = 0; i < count; ++i) {
      to[i] = static_cast<std::int16_t>(encoded_[static_cast<std::size_t>(to[i])]);
    }
    if (options_.noise.levels > 0) {
      for (std::size_t i = 0; i < count; ++i) {
        const float value = static_cast<float>(to[i]) + curve_.levels * normal_[second + i];
        to[i] = static_cast<std::int16_t>(std::clamp(value, 0.0F, static_cast<float>(kMaxLevel)));
      }
    }
  }
}

}  // namespace nodal::hal::sim
