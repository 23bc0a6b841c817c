#include "tests/bench/drawn_rig.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <random>

#include "stitch/geometry/rotation.h"
#include "stitch/registration/drift.h"
#include "tests/bench/fault_effect.h"

namespace nodal::bench {
namespace {

using Random = std::mt19937_64;
constexpr double kDegree = std::numbers::pi / 180;

double between(Random& random, double least, double most) {
  return std::uniform_real_distribution<double>(least, most)(random);
}

/// The scene, with a smooth sky inside a cone.
class WithSky final : public hal::sim::Scene {
 public:
  WithSky(hal::sim::ScenePtr scene, const Eigen::Vector3d& axis, double reach_rad, const Eigen::Vector3d& brighter)
      : scene_(std::move(scene)), axis_(axis), reach_(reach_rad), brighter_(brighter) {}
  hal::sim::Light light(const hal::sim::Direction& from, double footprint_rad) const override {
    const Eigen::Vector3d d(from.x, from.y, from.z);
    const double inside = (reach_ - std::acos(std::clamp(d.dot(axis_), -1.0, 1.0))) / kEdge;
    const hal::sim::Light seen_light = scene_->light(from, footprint_rad);
    if (inside <= 0) return seen_light;
    const double share = inside >= 1 ? 1 : inside * inside * (3 - 2 * inside);
    const auto level = static_cast<float>(0.55 + 0.2 * d.dot(brighter_));
    const auto mixed = [&](float scene, float sky) {
      return static_cast<float>((1 - share) * static_cast<double>(scene) + share * static_cast<double>(sky));
    };
    return {mixed(seen_light.r, 0.8F * level), mixed(seen_light.g, level), mixed(seen_light.b, 1.2F * level)};
  }

 private:
  static constexpr double kEdge = 10 * kDegree;  // the sky begins gradually
  const hal::sim::ScenePtr scene_;
  const Eigen::Vector3d axis_;
  const double reach_;
  const Eigen::Vector3d brighter_;
};

/// The town without its movers.
class StillTown final : public hal::sim::Scene {
 public:
  explicit StillTown(std::uint64_t seed) : town_(hal::sim::town_square_scene(seed)) {}
  hal::sim::Light light(const hal::sim::Direction& from, double footprint_rad) const override {
    return town_->light(from, footprint_rad);
  }

 private:
  const hal::sim::ScenePtr town_;
};

Eigen::Vector3d unit_vector(Random& random) {
  std::normal_distribution<double> normal;
  const double x = normal(random), y = normal(random), z = normal(random);
  return Eigen::Vector3d(x, y, z).normalized();
}

Eigen::Vector3d axis_of(const HeadCalibration& head) { return geometry::matrix_of(head.R_head_rig).row(2).transpose(); }

/// `count` heads of a six-fisheye rig, on a ring or on a spiral over the sphere, each with a random roll.
Calibration arranged(int count, int side, double view_deg, bool ring, Random& random) {
  Calibration rig = test::six_fisheyes(side, view_deg);
  const HeadCalibration model = rig.heads.front();
  rig.heads.clear();
  for (int h = 0; h < count; ++h) {
    const double height = ring ? between(random, -0.2, 0.2) : 1 - (2 * h + 1.0) / count;
    const double turn = ring ? 2 * std::numbers::pi * h / count : h * std::numbers::pi * (3 - std::sqrt(5.0));
    const double across = std::sqrt(1 - height * height);
    const Eigen::Quaterniond stands =
        Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(),
                                           Eigen::Vector3d(across * std::sin(turn), -height, across * std::cos(turn))) *
        Eigen::Quaterniond(Eigen::AngleAxisd(between(random, -3, 3), Eigen::Vector3d::UnitZ()));
    HeadCalibration head = model;
    head.name = "cam" + std::to_string(h);
    const Eigen::Matrix3d R = stands.toRotationMatrix().transpose();
    for (int k = 0; k < 9; ++k) head.R_head_rig[static_cast<std::size_t>(k)] = R(k / 3, k % 3);
    rig.heads.push_back(head);
  }
  return rig;
}

Calibration shape_of(Random& random) {
  switch (random() % 4) {
    case 0: return arranged(4, 200, between(random, 190, 205), true, random);
    case 1: return arranged(10, 128, between(random, 95, 110), false, random);
    case 2: return arranged(8, 144, between(random, 95, 110), true, random);
    default: return test::six_fisheyes(160, between(random, 120, 140));
  }
}

/// The calibration's lens is equidistant. `amount` 1: focal lengths 0.5 %, centres 0.5 px, 0.7 % of the rim's
/// curvature.
void bend_lenses(Calibration& rig, double amount, Random& random) {
  const double common = between(random, -1, 1);
  for (HeadCalibration& head : rig.heads) {
    auto& lens = std::get<EquidistantLens>(head.lens);
    const double focal = lens.coefficients[0], rim = head.width / 2.0 / focal;
    const double bent = 0.007 * amount * (common + 0.3 * between(random, -1, 1)) * focal / (rim * rim);
    lens.coefficients = {focal * (1 + 0.005 * amount * between(random, -1, 1)), 0, bent};
    head.center_x += 0.5 * amount * between(random, -1, 1);
    head.center_y += 0.5 * amount * between(random, -1, 1);
    head.vignetting.x = head.center_x;
    head.vignetting.y = head.center_y;
  }
}

std::vector<std::uint8_t> blurred(const std::vector<std::uint8_t>& picture, int width, int height, int reach) {
  std::vector<std::uint8_t> result;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      int sum = 0, count = 0;
      for (int j = std::max(0, y - reach); j <= std::min(height - 1, y + reach); ++j) {
        for (int i = std::max(0, x - reach); i <= std::min(width - 1, x + reach); ++i, ++count) {
          sum += picture[static_cast<std::size_t>(j * width + i)];
        }
      }
      result.push_back(static_cast<std::uint8_t>(sum / count));
    }
  }
  return result;
}

/// Out of focus by `reach` pixels, or, with a reach of 0, with a `contrast` below 1 and noise.
struct Weakness {
  int reach = 0;
  double contrast = 1;
  bool any() const { return reach > 0 || contrast < 1; }
  double noise() const { return reach > 0 ? 1.0 : 3.0; }
};

void weaken(test::RenderedRig& rig, std::size_t h, const Weakness& weakness, Random& random) {
  std::vector<std::uint8_t>& picture = rig.bytes[h];
  if (weakness.reach > 0)
    picture = blurred(picture, rig.truth.heads[h].width, rig.truth.heads[h].height, weakness.reach);
  std::normal_distribution<double> noise(0, weakness.noise());
  for (std::uint8_t& pixel : picture) {
    const double level = 120 + weakness.contrast * (pixel - 120.0) + noise(random);
    pixel = static_cast<std::uint8_t>(std::clamp(std::lround(level), 0L, 255L));
  }
}

/// A description of one picture-taking, so that it can be repeated with other noise.
struct Session {
  Calibration truth;
  hal::sim::ScenePtr scene;
  std::optional<test::Room> room;
  std::size_t weak = 0;
  Weakness weakness;
};

test::RenderedRig film(const Session& session, std::uint64_t seed) {
  const test::RenderOptions options{PixelFormat::kGrey8, kNoiseLevels, seed, 3};
  test::RenderedRig rig = session.room ? test::render_rig_in(*session.room, session.truth, session.scene, options)
                                       : test::render_rig(session.truth, session.scene, options);
  Random random(seed + 77);
  if (session.weakness.any()) weaken(rig, session.weak, session.weakness, random);
  return rig;
}

test::Room room_of(Random& random) {
  test::Room room{test::Room::Shape::kBox, between(random, 3, 6), {}};
  const int people = 3 + static_cast<int>(random() % 6);
  for (int k = 0; k < people; ++k) {
    const double yaw = between(random, 0, 2 * std::numbers::pi), far = between(random, 1.2, 2.5);
    room.columns.push_back({far * std::sin(yaw), far * std::cos(yaw), 0.25});
  }
  return room;
}

/// The error of a head's rotation relative to the head that is held, degrees.
double error_of(const Calibration& truth, const Calibration& found, std::size_t held, std::size_t h) {
  std::vector<bool> counted(truth.heads.size(), false);
  counted[held] = counted[h] = true;
  // Two heads share the relative error, so the mean error is half of it.
  return 2 * test::rotation_error(truth, found, counted).max_deg;
}

bool says(const std::vector<std::string>& texts, std::initializer_list<const char*> words) {
  return std::ranges::any_of(texts, [&](const std::string& text) {
    return std::ranges::any_of(words, [&](const char* word) { return text.find(word) != std::string::npos; });
  });
}

constexpr double kAboveNoise = 1;  // FaultEffect's parallax and lens
// FaultEffect::head_px: no estimate is better than interpolation and blur are exact.
constexpr double kUndeterminedPx = 0.01;

void weigh_reasons(const DrawnRig& rig, const std::vector<std::string>& texts, Verdict& verdict) {
  const FaultEffect effect = effect_of(rig);
  const bool all = rig.fault == Fault::kAll;
  const bool near = all || rig.fault == Fault::kParallax, lens = all || rig.fault == Fault::kWrongLens;
  const bool detail = rig.fault != Fault::kNone && (all || !(near || lens));
  verdict.reasons = {
      {{detail, detail && std::ranges::max(effect.head_px) > kUndeterminedPx,
        says(texts, {"no detail", "less detail", "the detail it shares"})},
       {near, effect.parallax > kAboveNoise, says(texts, {"near things"})},
       {lens, effect.lens > kAboveNoise, says(texts, {"lenses may not fit", "focal lengths are about"})}}};
}

}  // namespace

const char* name_of(Fault fault) {
  constexpr std::array<const char*, kFaults> kNames{"none",     "weak head",  "smooth head", "first head blind",
                                                    "parallax", "wrong lens", "all at once"};
  return kNames[static_cast<std::size_t>(fault)];
}

DrawnRig draw_rig(std::uint64_t seed) {
  Random random(seed);
  DrawnRig drawn;
  drawn.fault = static_cast<Fault>(seed % kFaults);
  const bool all = drawn.fault == Fault::kAll;
  Session session;
  const Calibration nominal = shape_of(random);
  session.truth = nominal;
  if (drawn.fault == Fault::kWrongLens || all)
    bend_lenses(session.truth, between(random, 0.1, 1) * (all ? 0.3 : 1), random);
  if (drawn.fault == Fault::kParallax || all) {
    session.truth = test::spread_out(session.truth, between(random, 0.02, 0.15) * (all ? 0.4 : 1));
    session.room = room_of(random);
  }
  session.scene = std::make_shared<StillTown>(1 + random() % 1000);
  const std::size_t heads = nominal.heads.size();
  const bool first = drawn.fault == Fault::kFirstBlind;
  if (first || drawn.fault == Fault::kSmoothHead || all) {
    const HeadCalibration& head = session.truth.heads[first ? 0 : 1 + random() % (heads - 1)];
    const double view = head.width / 2.0 / std::get<EquidistantLens>(head.lens).coefficients[0];
    const double reach = view * (first ? between(random, 1.2, 1.5) : between(random, 0.7, 1.3));
    session.scene =
        std::make_shared<WithSky>(session.scene, axis_of(head), std::min(reach, 100 * kDegree), unit_vector(random));
  }
  if (drawn.fault == Fault::kWeakHead || all) {
    session.weak = random() % heads;
    if (random() % 2 == 0) session.weakness.reach = 2 + static_cast<int>(random() % 11);
    else session.weakness.contrast = between(random, 0.05, 0.4);
  }
  drawn.seen = film(session, 2 * seed + 1);
  drawn.again = film(session, 2 * seed + 2);
  drawn.room = session.room;
  drawn.noise.assign(heads, kNoiseLevels);
  if (session.weakness.any()) drawn.noise[session.weak] = session.weakness.noise();
  drawn.prior = test::turned(session.truth, 0.2, 2, seed);
  for (std::size_t h = 0; h < heads; ++h) {
    drawn.prior.heads[h].lens = nominal.heads[h].lens;
    drawn.prior.heads[h].center_x = nominal.heads[h].center_x;
    drawn.prior.heads[h].center_y = nominal.heads[h].center_y;
    // Nobody measured where the heads stand, in every second rig.
    if (seed / kFaults % 2 == 1) drawn.prior.heads[h].position = {};
  }
  constexpr registration::Free kFree[] = {registration::Free::kRotations, registration::Free::kRotations,
                                          registration::Free::kFocals, registration::Free::kLens};
  drawn.options.free = kFree[random() % 4];
  return drawn;
}

Verdict judge(const DrawnRig& rig, bool with_drift) {
  Verdict verdict;
  const Calibration& truth = rig.seen.truth;
  const auto report = registration::register_heads(rig.prior, {rig.seen.frames()}, rig.options);
  if (!report) {
    verdict.refused = report.error().text();
    weigh_reasons(rig, {verdict.refused}, verdict);
    return verdict;
  }
  std::size_t held = 0;
  while (!report->heads[held].placed) ++held;
  for (std::size_t h = 0; h < truth.heads.size(); ++h) {
    const registration::HeadReport& head = report->heads[h];
    if (!head.placed) verdict.not_placed.push_back(head.name);
    else if (h != held)
      verdict.placed.push_back({head.name, error_of(truth, report->calibration, held, h), head.sigma_deg});
  }
  verdict.warnings = report->warnings;
  weigh_reasons(rig, report->warnings, verdict);
  if (!with_drift) return verdict;
  const auto drift = registration::measure_drift(report->calibration, {rig.again.frames()}, {});
  if (!drift) {
    verdict.drift_refused = drift.error().text();
    return verdict;
  }
  for (std::size_t h = 0; h < drift->heads.size(); ++h) {
    // A head that is not placed has the prior's wrong rotation, from which it did move.
    const bool moved = drift->heads[h].standing == registration::Standing::kMoved;
    if (moved && report->heads[h].placed) ++verdict.false_moves;
  }
  return verdict;
}

}  // namespace nodal::bench
