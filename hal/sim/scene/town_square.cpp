// The default scene, in metres, with the nodal point 1.7 m above the paving. Every ray is shaded by formulas; only a
// few lists of objects are stored.
#include <array>
#include <cmath>
#include <numbers>
#include <string_view>

#include "hal/sim/scene/random.h"
#include "hal/sim/scene/scene.h"
#include "hal/sim/scene/texture.h"

namespace nodal::hal::sim {

namespace {

constexpr double kEyeHeight = 1.7;
constexpr double kFar = 1e9;
constexpr Direction kSun{0.4851, -0.7276, -0.4851};  // unit: high, behind to the right
constexpr Light kHaze{0.62F, 0.72F, 0.84F};

/// A factor of about 1, varied by noise, at least 0.12.
float varied(double by) { return static_cast<float>(std::max(0.12, 1 + by)); }

// 5x7 letters, one byte per row, the leftmost cell in bit 4.
struct Glyph {
  char letter;
  std::array<std::uint8_t, 7> rows;
};
constexpr std::array<Glyph, 13> kGlyphs{{
    {'A', {14, 17, 17, 31, 17, 17, 17}},
    {'B', {30, 17, 17, 30, 17, 17, 30}},
    {'C', {14, 17, 16, 16, 16, 17, 14}},
    {'E', {31, 16, 16, 30, 16, 16, 31}},
    {'F', {31, 16, 16, 30, 16, 16, 16}},
    {'G', {14, 17, 16, 23, 17, 17, 15}},
    {'H', {17, 17, 17, 31, 17, 17, 17}},
    {'I', {14, 4, 4, 4, 4, 4, 14}},
    {'K', {17, 18, 20, 24, 20, 18, 17}},
    {'L', {16, 16, 16, 16, 16, 16, 31}},
    {'N', {17, 25, 21, 19, 17, 17, 17}},
    {'O', {14, 17, 17, 17, 17, 17, 14}},
    {'R', {30, 17, 17, 30, 20, 18, 17}},
}};

bool letter_cell(char letter, int column, int row) {
  if (letter == 'T') return row == 0 || column == 2;
  for (const Glyph& glyph : kGlyphs) {
    if (glyph.letter == letter) return ((glyph.rows[static_cast<std::size_t>(row)] >> (4 - column)) & 1) != 0;
  }
  return false;
}

struct Wall {
  std::string_view word;
  double distance;   ///< distance of its plane, m
  double reach;      ///< from its middle to each side, m; the corners are open streets
  Direction normal;  ///< away from the nodal point
  Direction right;   ///< seen from the nodal point
};
constexpr std::array<Wall, 4> kWalls{{{"FRONT", 22, 21, {0, 0, 1}, {1, 0, 0}},
                                      {"RIGHT", 27, 17, {1, 0, 0}, {0, 0, -1}},
                                      {"BACK", 22, 21, {0, 0, -1}, {-1, 0, 0}},
                                      {"LEFT", 27, 17, {-1, 0, 0}, {0, 0, 1}}}};
constexpr std::array<Light, 7> kPlaster{{{0.62F, 0.47F, 0.30F},
                                         {0.66F, 0.60F, 0.50F},
                                         {0.50F, 0.24F, 0.17F},
                                         {0.42F, 0.50F, 0.45F},
                                         {0.70F, 0.55F, 0.22F},
                                         {0.45F, 0.42F, 0.52F},
                                         {0.58F, 0.36F, 0.33F}}};

struct Ball {
  double x, y, z, radius;
};
struct Post {
  double x, z, radius, height;
};

class TownSquare final : public Scene {
 public:
  explicit TownSquare(std::uint64_t seed) : seed_(static_cast<std::uint32_t>(seed)) {
    plant(seed);
    launch();
  }

  std::span<const Mover> movers() const override { return movers_; }

  Light light(const Direction& d, double footprint) const override {
    // The nearest surface is found first; only that one is shaded.
    Hit hit;
    meet_walls(d, hit);
    const bool paved = d.y > 1e-4 && kEyeHeight / d.y < hit.t;
    if (paved) hit.t = kEyeHeight / d.y;
    double nearest = hit.t;
    Light seen;
    if (trees(d, footprint, nearest, seen)) {
      posts(d, nearest, seen);
      return seen;
    }
    if (posts(d, nearest, seen)) return seen;
    // Distant paving fades into haze, so that there is no hard edge where the ground meets the hills.
    if (paved) return mix(paving(d, hit.t, footprint), kHaze * 0.8F, 1 - std::exp(-hit.t / 260));
    if (hit.wall != nullptr) return facade(hit, footprint * hit.t) * static_cast<float>(hit.lit);
    if (hit.tower) return tower(hit, footprint * hit.t);
    return sky(d, footprint);
  }

 private:
  void plant(std::uint64_t seed) {
    Random random(seed, "trees");
    for (int i = 0; i < 8; ++i) {
      // Two at each corner, where they cover no word on a wall.
      const double corner = 45 + 90 * (i / 2) + (i % 2 == 0 ? -9 : 9);
      const double angle = (corner + static_cast<double>(random.below(60)) / 10 - 3) * std::numbers::pi / 180;
      const double away = 10 + static_cast<double>(random.below(500)) / 100;
      const double radius = 1.6 + static_cast<double>(random.below(90)) / 100;
      const double x = away * std::sin(angle);
      const double z = away * std::cos(angle);
      crowns_.push_back({x, kEyeHeight - 3.6 - radius * 0.6, z, radius});
      crowns_.push_back({x + radius * 0.7, kEyeHeight - 3.0 - radius * 0.4, z + 0.3, radius * 0.7});
      posts_.push_back({x, z, 0.16, 3.4});
    }
    for (int i = 0; i < 6; ++i) {
      const double angle = (i + 0.5) * std::numbers::pi / 3;
      posts_.push_back({6.5 * std::sin(angle), 6.5 * std::cos(angle), 0.05, 4.4});
    }
  }

  void launch() {
    const auto balloon = [&](double yaw, double pitch, double seconds, double degrees, Light a, Light b) {
      const double t = yaw * std::numbers::pi / 180;
      const double p = pitch * std::numbers::pi / 180;
      const Direction start{std::sin(t) * std::cos(p), -std::sin(p), std::cos(t) * std::cos(p)};
      // Tilted slightly from the vertical, so that each also rises and sinks.
      const double tilt = 0.12 * std::sin(3 * t);
      const Direction axis{std::sin(tilt), -std::cos(tilt), 0};
      movers_.push_back({axis, start, Duration::milliseconds(static_cast<std::int64_t>(seconds * 1000)),
                         degrees * std::numbers::pi / 180, a, b});
    };
    balloon(10, 24, 40, 3.4, {0.9F, 0.12F, 0.08F}, {0.95F, 0.85F, 0.2F});
    balloon(75, 33, -52, 2.6, {0.1F, 0.35F, 0.85F}, {0.9F, 0.9F, 0.92F});
    balloon(140, 20, 61, 3.0, {0.1F, 0.6F, 0.2F}, {0.95F, 0.8F, 0.15F});
    balloon(205, 40, -47, 2.2, {0.75F, 0.1F, 0.55F}, {0.95F, 0.95F, 0.95F});
    balloon(265, 27, 44, 2.8, {0.95F, 0.45F, 0.05F}, {0.15F, 0.15F, 0.2F});
    balloon(320, 62, 33, 3.0, {0.1F, 0.65F, 0.7F}, {0.95F, 0.3F, 0.25F});
    balloon(40, -14, 14, 1.5, {0.9F, 0.9F, 0.1F}, {0.1F, 0.1F, 0.1F});  // a ball that rolls on the paving
  }

  Light sky(const Direction& d, double footprint) const {
    const double up = -d.y;
    const double to_sun = dot(d, kSun);
    Light light = mix(kHaze, {0.14F, 0.30F, 0.66F}, std::pow(std::clamp(up, 0.0, 1.0), 0.55));
    light = light + Light{1.0F, 0.9F, 0.7F} * static_cast<float>(0.35 * std::pow(std::max(0.0, to_sun), 24));
    if (up > 0.02) {
      // Clouds on a plane overhead, fading towards the horizon.
      const double reach = 1.6 / up;
      const double n = fractal(d.x * reach, 3.1, d.z * reach, footprint * reach / up, 6, seed_ + 50);
      const double cover = std::clamp((n + 0.02) * 4.5, 0.0, 1.0) * std::clamp((up - 0.02) * 6, 0.0, 1.0);
      const double shade = std::clamp(0.98 - 0.7 * n, 0.5, 1.0);
      light = mix(light, Light{0.95F, 0.94F, 0.92F} * static_cast<float>(shade), cover * 0.9);
    }
    if (to_sun > 0.9998) light = {6, 5.6F, 5};
    hills(d, footprint, light);
    return light;
  }

  void hills(const Direction& d, double footprint, Light& light) const {
    const double level = std::sqrt(d.x * d.x + d.z * d.z);
    if (level < 0.9) return;
    const double x = d.x / level;
    const double z = d.z / level;
    const double slope = -d.y / level;
    const double ridge = 0.09 + 0.10 * fractal(3 * x, 0.5, 3 * z, 3 * footprint, 5, seed_ + 60);
    if (slope > ridge) return;
    const double wood = fractal(60 * x, 60 * slope, 60 * z, 60 * footprint, 4, seed_ + 70);
    const Light green{0.13F, 0.20F, 0.10F};
    light = mix(green * varied(0.8 * wood), kHaze, 0.35 + 0.3 * std::clamp(1 - slope / 0.1, 0.0, 1.0));
  }

  struct Hit {
    double t = kFar;
    const Wall* wall = nullptr;  ///< a wall of the square
    bool tower = false;          ///< a tower behind the wall
    std::int64_t side = 0, lot = 0;
    double s = 0;  ///< along the wall to the right, m
    double h = 0;  ///< above the ground, m
    double eaves = 0;
    double lit = 1;
  };

  void meet_walls(const Direction& d, Hit& hit) const {
    for (std::size_t k = 0; k < kWalls.size(); ++k) {
      const double ahead = dot(d, kWalls[k].normal);
      if (ahead < 0.05) continue;
      const double across = dot(d, kWalls[k].right);
      if (meet_house(d, k, ahead, across, hit)) continue;
      meet_tower(d, k, ahead, across, hit);
    }
  }

  bool meet_house(const Direction& d, std::size_t k, double ahead, double across, Hit& hit) const {
    const Wall& wall = kWalls[k];
    const double t = wall.distance / ahead;
    const double s = t * across;
    const double h = kEyeHeight - t * d.y;
    if (h < 0 || h > 22 || std::abs(s) > wall.reach || t > hit.t) return false;
    const auto side = static_cast<std::int64_t>(k);
    const auto lot = static_cast<std::int64_t>(std::floor(s / 7));
    const double chance = cell_value(lot, side, 1, seed_);
    const double eaves = 9 + 3 * std::floor(chance * 3.99);
    const bool gable = cell_value(lot, side, 2, seed_) > 0.45;
    const double along = s / 7 - static_cast<double>(lot);
    if (h > eaves + (gable ? 3.2 * (1 - std::abs(2 * along - 1)) : 0.6)) return false;
    // Brightness depends on the angle between wall and sun.
    const double lit = 0.38 + 0.55 * std::max(0.0, -dot(kSun, wall.normal)) + 0.12 * chance;
    hit = {t, &wall, false, side, lot, s, h, eaves, lit};
    return true;
  }

  void meet_tower(const Direction& d, std::size_t k, double ahead, double across, Hit& hit) const {
    const double distance = 75 + 9 * static_cast<double>(k);
    const double t = distance / ahead;
    const double s = t * across;
    const double h = kEyeHeight - t * d.y;
    if (h < 0 || h > 40 || std::abs(s) > distance || t > hit.t) return;
    const auto side = static_cast<std::int64_t>(k);
    const auto lot = static_cast<std::int64_t>(std::floor(s / 11));
    const double chance = cell_value(lot, side, 7, seed_);
    if (chance < 0.35 || h > 14 + 34 * (chance - 0.35)) return;
    hit = {t, nullptr, true, side, lot, s, h, 0, 1};
  }

  Light tower(const Hit& hit, double w) const {
    const double window = pulse_train(hit.s / 1.4, 0.55, w / 1.4) * pulse_train(hit.h / 2.9, 0.5, w / 2.9);
    const Light wall = mix({0.40F, 0.42F, 0.46F}, {0.55F, 0.50F, 0.44F}, cell_value(hit.lot, 3, 3, seed_));
    return mix(mix(wall, {0.12F, 0.16F, 0.22F}, window), kHaze, 0.35);
  }

  Light facade(const Hit& hit, double w) const {
    const double s = hit.s;
    const double h = hit.h;
    const auto colour = static_cast<std::size_t>(cell_value(hit.lot, hit.side, 4, seed_) * 6.999);
    const double grain = fractal(s * 1.1, h * 1.1, static_cast<double>(hit.side) * 40, w * 1.1, 5, seed_ + 10);
    Light light = kPlaster[colour] * (1.35F * varied(0.4 * grain));
    if (h > hit.eaves) {
      const double tiles = pulse_train(h / 0.3, 0.75, w / 0.3) * 0.3 + 0.7;
      return Light{0.42F, 0.16F, 0.10F} * (static_cast<float>(1.3 * tiles) * varied(0.5 * grain));
    }
    light = mix(light, {0.85F, 0.82F, 0.76F}, pulse_train(h / 3 + 0.02, 0.06, w / 3));
    // Joints between lots, drain pipes.
    light = mix(light, {0.10F, 0.09F, 0.08F}, pulse_train(s / 7 + 0.008, 0.016, w / 7));
    if (h < 3) return shop(hit, w, light);
    const double frame = pulse_train(s / 1.75 - 0.22, 0.56, w / 1.75) * pulse_train(h / 3 - 0.28, 0.56, w / 3);
    const double pane = pulse_train(s / 1.75 - 0.27, 0.46, w / 1.75) * pulse_train(h / 3 - 0.31, 0.50, w / 3);
    const double bars = 1 - 0.7 * pulse_train(s / 0.4375 + 0.05, 0.1, w / 0.4375);
    const auto room_s = static_cast<std::int64_t>(std::floor(s / 1.75));
    const auto room_h = static_cast<std::int64_t>(std::floor(h / 3));
    const double glow = cell_value(room_s, room_h, hit.side + 20, seed_);
    const Light glass = glow > 0.86 ? Light{0.95F, 0.72F, 0.32F} : mix({0.05F, 0.07F, 0.10F}, kHaze, 0.55 * glow);
    light = mix(light, {0.88F, 0.86F, 0.82F}, frame);
    light = mix(light, glass, pane * bars);
    return sign(hit.wall->word, s, h, light);
  }

  Light shop(const Hit& hit, double w, const Light& wall) const {
    const double s = hit.s;
    const double h = hit.h;
    const double along = s / 7 - static_cast<double>(hit.lot);
    const double hue = cell_value(hit.lot, hit.side, 5, seed_);
    const Light stripe = hue < 0.33   ? Light{0.65F, 0.08F, 0.07F}
                         : hue < 0.66 ? Light{0.05F, 0.28F, 0.14F}
                                      : Light{0.07F, 0.15F, 0.45F};
    if (h > 2.25) return mix({0.92F, 0.90F, 0.84F}, stripe, pulse_train(s / 0.5, 0.5, w / 0.5));
    const bool door = along > 0.42 && along < 0.58;
    if (door) return Light{0.22F, 0.13F, 0.07F} * static_cast<float>(0.8 + 0.4 * pulse_train(h / 0.55, 0.8, w / 0.55));
    if (h < 0.5 || along < 0.06 || along > 0.94) return wall * 0.7F;
    const double goods = fractal(s * 2.5, h * 2.5, static_cast<double>(hit.lot), w * 2.5, 4, seed_ + 30);
    return Light{0.42F, 0.33F, 0.2F} * (0.8F * varied(1.75 * goods));
  }

  /// The wall's word on a board between its first and second rows of windows.
  static Light sign(std::string_view word, double s, double h, const Light& behind) {
    constexpr double kCell = 0.36;
    const double columns = static_cast<double>(word.size()) * 6 - 1;
    const double column = s / kCell + columns / 2;
    const double row = (8.4 - h) / kCell;
    if (column < -1.5 || column > columns + 1.5 || row < -1.2 || row > 8.2) return behind;
    const Light board{0.05F, 0.06F, 0.16F};
    if (column < 0 || column >= columns || row < 0 || row >= 7) return board;
    const auto c = static_cast<int>(column);
    if (c % 6 == 5) return board;
    const bool ink = letter_cell(word[static_cast<std::size_t>(c / 6)], c % 6, static_cast<int>(row));
    return ink ? Light{0.98F, 0.96F, 0.90F} : board;
  }

  Light paving(const Direction& d, double t, double footprint) const {
    const double x = t * d.x;
    const double z = t * d.z;
    // A sample's footprint is longer along the line of sight than across it.
    const double across = footprint * t;
    const double along = across / std::max(d.y, 1e-3);
    const double level = std::max(1e-9, std::sqrt(d.x * d.x + d.z * d.z));
    const double wx = std::max(across, along * std::abs(d.x) / level);
    const double wz = std::max(across, along * std::abs(d.z) / level);
    const double wide = std::max(wx, wz);
    Light light = mix({0.46F, 0.43F, 0.39F}, {0.24F, 0.22F, 0.21F}, checker(x / 2, z / 2, wx / 2, wz / 2));
    const double joint =
        std::max(pulse_train(x / 0.5 + 0.03, 0.06, wx / 0.5), pulse_train(z / 0.5 + 0.03, 0.06, wz / 0.5));
    light = light * static_cast<float>(1 - 0.45 * joint);
    // A compass star around the foot of the rig; its red point shows forward.
    const double r = std::sqrt(x * x + z * z);
    if (r < 1.9) {
      const double angle = std::atan2(x, z);
      const double point = std::abs(std::remainder(angle, std::numbers::pi / 4)) * r;
      if (r > 1.75) {
        light = {0.12F, 0.12F, 0.13F};
      } else if (point < 0.12 * (1.75 - r)) {
        light = std::abs(angle) < std::numbers::pi / 8 ? Light{0.50F, 0.06F, 0.05F} : Light{0.56F, 0.52F, 0.40F};
      }
    }
    light = light * varied(0.9 * fractal(x * 1.3, 0.2, z * 1.3, wide * 1.3, 7, seed_ + 80));
    // Shadows of the tree crowns.
    const Direction from{x, kEyeHeight, z};
    for (const Ball& crown : crowns_) {
      if (shades(crown, from)) return light * 0.45F;
    }
    return light * 1.25F;
  }

  static bool shades(const Ball& ball, const Direction& from) {
    const Direction to{ball.x - from.x, ball.y - from.y, ball.z - from.z};
    const double along = dot(to, kSun);
    return along > 0 && dot(to, to) - along * along < ball.radius * ball.radius;
  }

  bool trees(const Direction& d, double footprint, double& nearest, Light& seen) const {
    bool any = false;
    for (const Ball& crown : crowns_) {
      const double along = d.x * crown.x + d.y * crown.y + d.z * crown.z;
      if (along <= 0 || along > nearest + crown.radius) continue;
      const double miss2 = crown.x * crown.x + crown.y * crown.y + crown.z * crown.z - along * along;
      const double r2 = crown.radius * crown.radius;
      if (miss2 > r2) continue;
      const double t = along - std::sqrt(r2 - miss2);
      if (t >= nearest) continue;
      const Direction p{t * d.x, t * d.y, t * d.z};
      const double leaf = fractal(p.x * 2.2, p.y * 2.2, p.z * 2.2, footprint * t * 2.2, 6, seed_ + 90);
      // A ragged rim: one sees through between the leaves.
      if (miss2 > r2 * (0.80 + 0.5 * leaf)) continue;
      const Direction normal{(p.x - crown.x) / crown.radius, (p.y - crown.y) / crown.radius,
                             (p.z - crown.z) / crown.radius};
      const double lit = 0.35 + 0.65 * std::max(0.0, dot(normal, kSun));
      seen = Light{0.24F, 0.40F, 0.10F} * (static_cast<float>(lit) * varied(1.5 * leaf));
      nearest = t;
      any = true;
    }
    return any;
  }

  bool posts(const Direction& d, double& nearest, Light& seen) const {
    const double flat2 = d.x * d.x + d.z * d.z;
    if (flat2 < 1e-6) return false;
    bool any = false;
    for (const Post& post : posts_) {
      const double along = d.x * post.x + d.z * post.z;
      if (along <= 0) continue;
      const double miss = (d.x * post.z - d.z * post.x);
      if (miss * miss > post.radius * post.radius * flat2) continue;
      const double t = along / flat2;
      const double h = kEyeHeight - t * d.y;
      if (t >= nearest || h < 0 || h > post.height) continue;
      const double side = miss / (post.radius * std::sqrt(flat2));
      const bool lamp = post.radius < 0.1;
      const Light light = lamp ? (h > post.height - 0.45 ? Light{1.1F, 1.0F, 0.8F} : Light{0.05F, 0.07F, 0.06F})
                               : Light{0.26F, 0.18F, 0.11F};
      seen = light * static_cast<float>(0.75 + 0.25 * side);
      nearest = t;
      any = true;
    }
    return any;
  }

  const std::uint32_t seed_;
  std::vector<Ball> crowns_;
  std::vector<Post> posts_;
  std::vector<Mover> movers_;
};

}  // namespace

ScenePtr town_square_scene(std::uint64_t seed) { return std::make_shared<TownSquare>(seed); }

}  // namespace nodal::hal::sim
